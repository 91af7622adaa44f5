#include "host/python/navigation_pool.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "catch2/catch.hpp"
#include "tests/support/paths.h"

namespace torquer::python {
namespace {

constexpr std::size_t kEnvironments = 6;

Scene TwoBranches() {
  const std::string folder = test::SourcePath("/host/scenes");
  return Scene::FromFile(folder + "/ty_phantom.toml");
}

NavigationTask IntoTheSide(const Scene& scene) {
  NavigationTask task;
  task.within_mm = 3;
  task.step_s = 0.1;
  task.longest_mm = 2;
  task.largest_turn_rad = 0.5;
  task.force_limit_mN = 50;
  task.max_steps = 400;
  task.route = scene.RouteMm("side", 40, 1);
  return task;
}

// Buffers for the output of all environments.
class Side {
 public:
  Side(const Scene& scene, const NavigationTask& task)
      : vector_size_(Navigation(scene, task).vector_size()),
        vectors_(kEnvironments * vector_size_),
        facts_(kFacts * kEnvironments) {}

  NavigationBuffers buffers() {
    NavigationBuffers buffers;
    buffers.vectors = vectors_.data();
    buffers.facts = facts_.data();
    return buffers;
  }
  const std::vector<float>& vectors() const { return vectors_; }
  const std::vector<double>& facts() const { return facts_; }

 private:
  std::size_t vector_size_;
  std::vector<float> vectors_;
  std::vector<double> facts_;
};

// Actions of an environment, the same on every call.
std::vector<double> Action(std::size_t index, int step, std::size_t size) {
  std::mt19937 random(static_cast<unsigned>(1000 * index + static_cast<std::size_t>(step)));
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<double> action(size);
  for (double& part : action) part = uniform(random);
  action[0] = 0.3 + 0.7 * std::abs(action[0]);
  return action;
}

TEST_CASE("Environments give the same in threads as in one, for any order of waiting") {
  constexpr int kSteps = 12;
  const Scene scene = TwoBranches();
  const NavigationTask task = IntoTheSide(scene);
  Side alone(scene, task), side(scene, task);
  {
    NavigationPool one(scene, task, kEnvironments, 1, alone.buffers());
    for (std::size_t k = 0; k < kEnvironments; ++k)
      one.Reset(k, {.rotation_rad = 0.1 * static_cast<double>(k)});
    one.Wait(kEnvironments);
    for (int step = 0; step < kSteps; ++step) {
      for (std::size_t k = 0; k < kEnvironments; ++k) {
        one.Step(k, Action(k, step, one.action_size()));
      }
      CHECK(one.Wait(kEnvironments).size() == kEnvironments);
    }
  }
  NavigationPool many(scene, task, kEnvironments, 4, side.buffers());
  for (std::size_t k = 0; k < kEnvironments; ++k)
    many.Reset(k, {.rotation_rad = 0.1 * static_cast<double>(k)});
  std::vector<int> steps(kEnvironments, 0);
  std::size_t finished = 0;
  // The first finished environment continues at once while the others still work.
  while (finished < kEnvironments) {
    for (const std::size_t k : many.Wait(1)) {
      CHECK(side.facts()[k] <= 10.2);  // read while others write
      if (steps[k] == kSteps) {
        ++finished;
      } else {
        many.Step(k, Action(k, steps[k]++, many.action_size()));
      }
    }
  }
  CHECK(many.at_work() == 0);
  CHECK(side.vectors() == alone.vectors());
  CHECK(side.facts() == alone.facts());
  CHECK(*std::max_element(side.facts().begin(), side.facts().end()) > 0);
}

TEST_CASE("An environment refuses NaN and infinity without effect") {
  const Scene scene = TwoBranches();
  Navigation environment(scene, IntoTheSide(scene));
  environment.Reset({.rotation_rad = 0.5});
  const auto facts = environment.facts();
  const std::uint64_t here = environment.simulation().state_hash();
  for (const double bad : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    const double feed[] = {bad, 0};
    const double turn[] = {0, bad};
    CHECK_THROWS_AS(environment.Step(feed), Error);
    CHECK_THROWS_AS(environment.Step(turn), Error);
    CHECK_THROWS_AS(environment.Reset({.rotation_rad = bad}), Error);
    NavigationTask task = IntoTheSide(scene);
    task.step_s = bad;
    CHECK_THROWS_AS(Navigation(scene, task), Error);
  }
  CHECK(environment.facts() == facts);
  CHECK(environment.simulation().state_hash() == here);
}

TEST_CASE("A pool ends while its environments are at work") {
  const Scene scene = TwoBranches();
  const NavigationTask task = IntoTheSide(scene);
  Side side(scene, task);
  for (int k = 0; k < 5; ++k) {
    NavigationPool pool(scene, task, kEnvironments, 3, side.buffers());
    for (std::size_t i = 0; i < kEnvironments; ++i) pool.Reset(i, {});
    pool.Wait(static_cast<std::size_t>(k));
  }
}

TEST_CASE("An exception of an environment reaches the waiting caller") {
  const Scene scene = TwoBranches();
  Side side(scene, IntoTheSide(scene));
  // The scene has no pictures.
  std::vector<std::uint8_t> pictures(kEnvironments);
  NavigationBuffers buffers = side.buffers();
  buffers.vectors = nullptr;
  buffers.pictures = pictures.data();
  buffers.picture_bytes = 1;
  NavigationPool pool(scene, IntoTheSide(scene), kEnvironments, 3, buffers);
  for (int again = 0; again < 2; ++again) {
    for (std::size_t k = 0; k < kEnvironments; ++k) pool.Reset(k, {});
    CHECK_THROWS_AS(pool.Wait(kEnvironments), Error);
    CHECK(pool.at_work() == 0);
  }
}

TEST_CASE("An environment that is exchanged goes on as one in its scene") {
  const Scene scene = TwoBranches();
  const NavigationTask task = IntoTheSide(scene);
  const Scene stiffer = scene.With({{"vessel.wall_stiffness_N_mm2", 0.02}});
  Side side(scene, task);
  NavigationPool pool(scene, task, kEnvironments, 2, side.buffers());
  Navigation single(stiffer, task);
  pool.Exchange(1, std::make_shared<Navigation>(stiffer, task));
  pool.Reset(1, {.rotation_rad = 0.3});
  single.Reset({.rotation_rad = 0.3});
  pool.Wait(1);
  for (int step = 0; step < 4; ++step) {
    const std::vector<double> action = Action(1, step, pool.action_size());
    pool.Step(1, action);
    pool.Wait(1);
    single.Step(action.data());
  }
  CHECK(pool.environment(1)->simulation().state_hash() == single.simulation().state_hash());
  CHECK(side.facts()[kEnvironments + 1] == single.facts()[1]);

  const Scene three = Scene::FromFile(test::SourcePath("/host/scenes/triaxial.toml"));
  NavigationTask other = task;
  other.route = {{0, 0, 0}};
  const auto next = std::make_shared<Navigation>(three.With({{"effects.wall_force", true}}), other);
  CHECK_THROWS_WITH(pool.Exchange(1, next), Catch::Contains("give scenes with the same ones"));
}

}  // namespace
}  // namespace torquer::python
