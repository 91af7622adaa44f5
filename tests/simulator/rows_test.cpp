// The same motion in rows of another size takes the wire the same way.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "host/simulator/simulation.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"

namespace {

using Eigen::Vector3d;

// Turns back and forth while it advances, in straight lines of 2 mm.
double RotationAt(double pushed_mm) {
  const auto at = [](double mm) {
    return 0.02 * mm + 0.8 * std::sin(2 * std::numbers::pi * mm / 40);
  };
  const double from_mm = 2 * std::floor(pushed_mm / 2);
  return std::lerp(at(from_mm), at(from_mm + 2), (pushed_mm - from_mm) / 2);
}

// The wire after every 2 mm of a push in rows of `row_mm`.
std::vector<std::vector<Vector3d>> Push(torquer::scene::Scene& scene, double push_mm,
                                        double row_mm) {
  torquer::simulator::Simulation simulation(scene);
  torquer::simulator::Command command;
  command.target = simulation.target();
  const torquer::InstrumentPlace start = command.target[0];
  std::vector<std::vector<Vector3d>> shapes;
  const int rows = static_cast<int>(std::lround(push_mm / row_mm));
  for (int k = 1; k <= rows; ++k) {
    const double pushed_mm = k * row_mm;
    command.time_s = pushed_mm / 20;
    command.target[0] = {start.insertion_mm + pushed_mm,
                         start.rotation_rad + RotationAt(pushed_mm)};
    torquer::CountedBudget budget(100000);
    simulation.Tick(command, budget);
    REQUIRE(simulation.report().arrived());
    const double blocks = pushed_mm / 2;
    if (std::abs(blocks - std::round(blocks)) < 1e-9) shapes.push_back(simulation.state().nodes());
  }
  return shapes;
}

}  // namespace

TEST_CASE("With friction the size of the rows does not decide where the wire goes", "[simulator]") {
  // Through the arch into a branch: with friction that is begun once a row, rows of 0.25 and 2 mm
  // end in branches 130 mm apart.
  torquer::scene::Scene scene(torquer::test::SourcePath("/host/scenes/neuro_arch.toml"));
  const double push_mm = torquer::test::Rounds(160, 20);
  const auto reference = Push(scene, push_mm, 0.25);
  for (const double row_mm : {0.5, 2.0}) {
    INFO("rows of " << row_mm << " mm");
    const auto shapes = Push(scene, push_mm, row_mm);
    REQUIRE(shapes.size() == reference.size());
    std::vector<double> apart_mm;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      REQUIRE(shapes[k].size() == reference[k].size());
      apart_mm.push_back((shapes[k].back() - reference[k].back()).norm());
    }
    CHECK(apart_mm.back() < 0.5);
    // A tip that snaps does so a row earlier or later; else it is at the same place.
    std::sort(apart_mm.begin(), apart_mm.end());
    CHECK(apart_mm[apart_mm.size() / 2] < 0.1);
    CHECK(apart_mm[apart_mm.size() * 9 / 10] < 2);
  }
}

TEST_CASE("Where snaps take time the size of the rows does not decide where the wire goes",
          "[simulator]") {
  const torquer::test::SceneFile file(std::string("linear_density_g_m = 0.7\n[effects.inertia]\n") +
                                      torquer::test::kFriction);
  torquer::scene::Scene scene(file.path());
  const double push_mm = torquer::test::Rounds(40, 10);
  const auto reference = Push(scene, push_mm, 0.25);
  // Rows of 0.5 and 2 mm are the same parts of 12.5 ms, but relaxed less where a row goes on; finer
  // rows are finer steps of time.
  for (const double row_mm : {0.5, 2.0, 0.05}) {
    INFO("rows of " << row_mm << " mm");
    const auto shapes = Push(scene, push_mm, row_mm);
    REQUIRE(shapes.size() == reference.size());
    double most_mm = 0;
    for (std::size_t k = 0; k < shapes.size(); ++k) {
      most_mm = std::max(most_mm, (shapes[k].back() - reference[k].back()).norm());
    }
    INFO("apart by " << most_mm << " mm");
    CHECK(most_mm < 0.3);
  }
}
