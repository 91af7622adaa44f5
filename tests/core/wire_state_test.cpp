#include "host/simulator/core/wire_state.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <vector>

#include "host/simulator/core/hash.h"
#include "tests/support/invariants.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

TEST_CASE("Feeding and retracting keep lengths exact, however it is done") {
  const WireModel model = MakeWire({.segment_mm = 1.5, .tip_mm = 6, .max_length_mm = 40});
  std::mt19937 random(2);
  std::uniform_real_distribution<double> feed(-0.75, 0.75);
  WireState state = Wander(model, 20, 0.3, random);
  int splits = 0;
  for (int k = 0; k < 3000; ++k) {
    // Drifts to one end and back, so that both ends are tested.
    const double wanted = feed(random) / 2 + (k / 500 % 2 ? -0.375 : 0.375);
    const double before = state.insertion_mm();
    const int segments = state.segments();
    const double to_mm = std::clamp(before + wanted, 0.0, 40.0);
    state.Feed(model, to_mm);
    REQUIRE_THAT(BrokenGeometry(model, state), Catch::Equals(""));
    REQUIRE(state.insertion_mm() == Approx(to_mm).margin(1e-12));
    if (state.segments() > 0) REQUIRE(state.ArcLength(model) == Approx(to_mm).margin(1e-9));
    splits += state.segments() != segments;
  }
  CHECK(splits > 50);
}

TEST_CASE("A wire in a bend slides along itself") {
  // After any feed along an arc of radius 20, the nodes lie on the arc. Only the end continues
  // straight.
  const WireModel model = MakeWire({.segment_mm = 1});
  const double radius = 20;
  std::vector<Vector3d> arc;
  for (double a = 0.01; a < 2; a += 0.01) {
    arc.emplace_back(radius * std::sin(a), radius * (1 - std::cos(a)), 0);
  }
  const auto off_arc = [&](const WireState& state, int nodes) {
    double worst = 0;
    for (int i = 0; i <= nodes; ++i) {
      worst = std::max(
          worst,
          std::abs((state.nodes()[static_cast<std::size_t>(i)] - Vector3d(0, radius, 0)).norm() -
                   radius));
    }
    return worst;
  };
  WireState state = WireState::Along(model, arc, {25.2, 0});
  REQUIRE(off_arc(state, state.segments()) < 1e-3);
  const int nodes = state.segments();
  for (int k = 0; k < 150; ++k) state.Feed(model, state.insertion_mm() + 0.02);
  // A feed that puts the nodes on the chords instead leaves the arc by lambda^2/4R per segment fed.
  // The end goes straight on, and the last nodes leave the arc with it.
  CHECK(off_arc(state, nodes - 4) < 0.005);
  CHECK(state.segments() == nodes + 3);

  state = WireState::Along(model, arc, {25.2, 0});
  for (int k = 0; k < 150; ++k) state.Feed(model, state.insertion_mm() - 0.02);
  CHECK(off_arc(state, state.segments()) < 0.005);
  CHECK(state.segments() == nodes - 3);
}

TEST_CASE("A first segment that splits keeps the curvature of the wire") {
  // Bends of a circle in a chain: the curvature times the length of each joint.
  const WireModel model = MakeWire({.segment_mm = 1});
  constexpr double kCurvature = 0.02;
  const double feed_mm = GENERATE(0.1, 0.3, 0.5);
  CAPTURE(feed_mm);
  WireState state = LayStraight(model, 20.45);
  std::vector<Vector3d> bent;  // the most distal first
  double angle_rad = 0;
  for (int i = 0; i < state.segments(); ++i) {
    angle_rad += kCurvature * JointLength(model, state, i);
    bent.push_back(Eigen::AngleAxisd(angle_rad, state.normals()[0]) * model.sheath().direction);
  }
  std::reverse(bent.begin(), bent.end());
  state.TurnDistal(model, bent);
  const int segments = state.segments();
  state.Feed(model, 20.45 + feed_mm);
  REQUIRE(state.segments() == segments + 1);
  Vector3d before = model.sheath().direction;
  for (int i = 0; i + 3 < state.segments(); ++i) {
    CAPTURE(i);
    const Vector3d& tangent = state.tangents()[static_cast<std::size_t>(i)];
    CHECK(before.cross(tangent).norm() ==
          Approx(kCurvature * JointLength(model, state, i)).epsilon(1e-3));
    before = tangent;
  }
}

TEST_CASE("The tip keeps its directions when the wire is fed") {
  const WireModel model = MakeWire({.tip_mm = 5});
  std::mt19937 random(3);
  WireState state = Wander(model, 20, 0.3, random);
  const std::vector<Vector3d> before = state.tangents();
  state.Feed(model, state.insertion_mm() + 0.4);
  for (std::size_t k = 1; k <= 5; ++k) {
    CHECK((state.tangents()[state.tangents().size() - k] - before[before.size() - k]).norm() == 0);
  }
  CHECK((state.tangents()[10] - before[10]).norm() > 1e-3);
}

TEST_CASE("A long feed is that in steps of half a segment") {
  const WireModel model = MakeWire({.segment_mm = 1, .tip_mm = 3, .max_length_mm = 40});
  std::mt19937 random(5);
  const WireState start = Wander(model, 12.3, 0.2, random);
  for (const double to_mm : {12.9, 14.8, 33.0, 11.1, 5.2, 0.0}) {
    CAPTURE(to_mm);
    WireState whole = start;
    whole.Feed(model, to_mm);
    WireState stepped = start;
    for (int left = static_cast<int>(std::ceil(2 * std::abs(to_mm - 12.3))); left > 0; --left) {
      stepped.Feed(model, stepped.insertion_mm() + (to_mm - stepped.insertion_mm()) / left);
    }
    CHECK_THAT(BrokenGeometry(model, whole), Catch::Equals(""));
    REQUIRE(whole.segments() == stepped.segments());
    CHECK(whole.insertion_mm() == to_mm);
    CHECK(LargestDistance(whole, stepped) < 1e-12);
  }
  WireState straight(model);
  straight.Feed(model, 7.4);
  CHECK_THAT(BrokenGeometry(model, straight), Catch::Equals(""));
  CHECK(LargestDistance(straight, LayStraight(model, 7.4)) < 1e-12);
}

TEST_CASE("A fully retracted wire is the wire at the start") {
  const WireModel model = MakeWire({.segment_mm = 1});
  std::mt19937 random(4);
  for (const double length : {0.3, 0.7, 5.0, 20.2}) {
    WireState state = Wander(model, length, 0.2, random);
    const double step = std::uniform_real_distribution<double>(0.05, 0.5)(random);
    while (state.insertion_mm() > 0) state.Feed(model, std::max(0.0, state.insertion_mm() - step));
    CHECK(state.segments() == 0);
    CHECK_THAT(BrokenGeometry(model, state), Catch::Equals(""));
    CHECK(HashState(state) == HashState(WireState(model)));
    // The wire must enter straight again.
    while (state.insertion_mm() < 3.4) state.Feed(model, state.insertion_mm() + 0.1);
    const WireState fresh = LayStraight(model, state.insertion_mm());
    REQUIRE(state.segments() == fresh.segments());
    CHECK(LargestDistance(state, fresh) < 1e-12);
  }
}

TEST_CASE("Less than half a segment is carried, without loss") {
  const WireModel model = MakeWire({.segment_mm = 2});
  WireState state(model);
  for (int k = 0; k < 9; ++k) state.Feed(model, state.insertion_mm() + 0.1);
  CHECK(state.segments() == 0);
  CHECK(state.insertion_mm() == Approx(0.9));
  state.Feed(model, state.insertion_mm() + 0.2);
  CHECK(state.segments() == 1);
  CHECK(state.ArcLength(model) == Approx(1.1));
  CHECK(state.nodes().back()[0] == Approx(1.1));
}

TEST_CASE("A wire laid along a path has exact lengths and follows within a segment") {
  const WireModel model = MakeWire({.segment_mm = 0.7, .max_length_mm = 300});
  std::vector<Vector3d> path;
  for (double t = 0; t < 12; t += 0.05) {
    path.emplace_back(10 * std::sin(t), 10 * (1 - std::cos(t)), 3 * t);
  }
  for (const double length : {0.0, 0.2, 0.35, 1.0, 50.0, 50.34, 50.36, 140.0}) {
    WireState state = WireState::Along(model, path, {length, 0});
    INFO("length " << length);
    CHECK_THAT(BrokenGeometry(model, state), Catch::Equals(""));
    CHECK(state.insertion_mm() == Approx(length));
    for (const Vector3d& x : state.nodes()) {
      double nearest = 1e9;
      for (std::size_t k = 1; k < path.size(); ++k) {
        const Vector3d ab = path[k] - path[k - 1];
        const double t = std::clamp((x - path[k - 1]).dot(ab) / ab.squaredNorm(), 0.0, 1.0);
        nearest = std::min(nearest, (path[k - 1] + t * ab - x).norm());
      }
      const bool past_the_end = length > 120 && x[2] > path.back()[2] - 1;
      if (!past_the_end) CHECK(nearest < 1e-9);
    }
  }
  // Past the path's end the wire continues straight.
  WireState state = WireState::Along(model, path, {200, 0});
  CHECK((state.tangents().back() - *(state.tangents().end() - 20)).norm() < 1e-12);
  // Without a path the wire leaves the sheath straight. A target out of range is clamped.
  state = WireState::Along(model, {}, {1e9, 0});
  CHECK(state.insertion_mm() == 300);
  CHECK((state.nodes().back() - Vector3d(300, 0, 0)).norm() < 1e-9);
}

TEST_CASE("Parallel transport is the smallest rotation") {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const auto unit = [&] {
    return Vector3d(normal(random), normal(random), normal(random)).normalized();
  };
  for (int k = 0; k < 200; ++k) {
    const Vector3d from = unit();
    const Vector3d to = unit();
    const Vector3d across = from.cross(unit()).normalized();
    const Vector3d expected = Eigen::Quaterniond::FromTwoVectors(from, to) * across;
    CHECK((ParallelTransport(across, from, to) - expected).norm() < 1e-9);
  }
  // Opposite directions have no unique smallest rotation; any rotation onto the target is valid.
  const Vector3d turned =
      ParallelTransport(Vector3d::UnitY(), Vector3d::UnitX(), -Vector3d::UnitX());
  CHECK(turned.norm() == Approx(1));
  CHECK(turned[0] == 0);
}

TEST_CASE("Rest directions follow the untwisted frame, for any stored frames") {
  const WireModel model = MakeWire({.tip_mm = 12, .tip_curvature_1_per_mm = 0.2});
  std::mt19937 random(6);
  std::uniform_real_distribution<double> angle(-3, 3);
  WireState state = Wander(model, 30, 0.6, random);
  state.Rotate(0.8);

  // The untwisted frame, rotated, computed with quaternions only.
  std::vector<Vector3d> expected;
  Vector3d u = model.sheath().direction;
  Vector3d a = model.sheath_normal();
  for (int joint = 0; joint < state.segments(); ++joint) {
    if (joint > 0) {
      const Vector3d& next = state.tangents()[static_cast<std::size_t>(joint - 1)];
      a = Eigen::Quaterniond::FromTwoVectors(u, next) * a;
      u = next;
    }
    const Vector3d first = Eigen::AngleAxisd(0.8, u) * a;
    const int from_tip = state.segments() - joint;
    const Vector3d& rest = model.rest_direction(from_tip);
    expected.emplace_back(rest[0] * first + rest[1] * u.cross(first) + rest[2] * u);
  }
  // Joints 0 and 1 have other lengths; neither is in the tip here.
  REQUIRE(state.segments() - 1 > model.first_straight_joint());
  const auto check = [&] {
    for (int joint = 0; joint < state.segments(); ++joint) {
      INFO("joint " << joint);
      CHECK(
          (RestDirection(model, state, joint) - expected[static_cast<std::size_t>(joint)]).norm() <
          1e-12);
    }
  };
  state.UpdateFrames(model);
  check();
  std::vector<double> spin_rad(state.normals().size());
  for (double& spin : spin_rad) spin = angle(random);
  state = Spun(model, state, spin_rad);
  state.UpdateFrames(model);
  check();
  state.UntwistFrames(model);
  check();
}

TEST_CASE("A closed loop of tangents turns the frame by the solid angle it encloses") {
  // Tangents along x, y, z, x: an eighth of the sphere, pi/2.
  Vector3d normal = Vector3d::UnitY();
  const Vector3d loop[] = {Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ(),
                           Vector3d::UnitX()};
  for (int k = 0; k < 3; ++k) normal = ParallelTransport(normal, loop[k], loop[k + 1]);
  const double angle = std::atan2(normal[2], normal[1]);
  CHECK(angle == Approx(std::numbers::pi / 2));
}

TEST_CASE("At a split and a merge the rest shape and the stiffness of the clamp go on evenly") {
  const WireModel model = MakeWire({.segment_mm = 1, .tip_mm = 20, .tip_curvature_1_per_mm = 0.1});
  const auto rest_turn = [&](const WireState& state) {
    double sum = 0;
    for (int joint = 0; joint < state.segments(); ++joint) {
      const Vector3d& before = joint == 0 ? model.sheath().direction
                                          : state.tangents()[static_cast<std::size_t>(joint - 1)];
      sum += std::acos(RestDirection(model, state, joint).dot(before));
    }
    return sum;
  };
  const WireState before = LayStraight(model, 5.5 - 1e-9);
  const WireState after = LayStraight(model, 5.5 + 1e-9);
  REQUIRE(after.segments() == before.segments() + 1);
  CHECK(rest_turn(before) == Approx(rest_turn(after)).epsilon(1e-6));
  CHECK(rest_turn(before) == Approx(0.1 * 5.0).epsilon(1e-6));  // the last half segment is straight
}

TEST_CASE("Different states have different hashes, and equal states the same one") {
  const WireModel model = MakeWire({});
  const WireState a = LayStraight(model, 10);
  WireState b = a;
  CHECK(HashState(a) == HashState(b));
  std::vector<Vector2d> xi(a.tangents().size(), Vector2d::Zero());
  xi[3][0] = 1e-14;
  b = Stepped(model, a, xi);
  CHECK(HashState(a) != HashState(b));
  b = a;
  b.Rotate(1e-9);
  CHECK(HashState(a) != HashState(b));
  // Frames and instrument poses determine the further motion, so the hash includes them.
  b = Spun(model, a, std::vector<double>(a.tangents().size(), 1e-9));
  CHECK(HashState(a) != HashState(b));
  b = a;
  b.MoveInstruments(model, {10, 1});
  CHECK(HashState(a) != HashState(b));
}

TEST_CASE("A hash detects any two different bits, signs, and mirror images") {
  const double numbers[] = {1.25, -3e-7, 17};
  const auto hash_of = [&](std::uint64_t first, std::uint64_t second) {
    const std::uint64_t flips[] = {first, second, 0};
    std::uint64_t hash = kHashSeed;
    for (int k = 0; k < 3; ++k) {
      hash = HashDouble(std::bit_cast<double>(std::bit_cast<std::uint64_t>(numbers[k]) ^ flips[k]),
                        hash);
    }
    return hash;
  };
  const std::uint64_t whole = hash_of(0, 0);
  int unseen = 0;
  for (int a = 0; a < 64; ++a) {
    for (int b = 0; b < 64; ++b) {
      unseen += hash_of(std::uint64_t{1} << a, std::uint64_t{1} << b) == whole ? 1 : 0;
    }
  }
  CHECK(unseen == 0);
  // A bend to the left and one to the right: two numbers of each node and tangent change sign.
  const auto bent = [](double towards) {
    std::vector<Vector3d> path;
    for (double a = 0.1; a < 1; a += 0.1) {
      path.emplace_back(20 * std::sin(a), towards * 20 * (1 - std::cos(a)),
                        towards * 5 * (1 - std::cos(a)));
    }
    const WireModel model = MakeWire({.segment_mm = 1});
    const WireState state = WireState::Along(model, path, {10, 0});
    return HashVectors(state.nodes(), HashVectors(state.tangents(), kHashSeed));
  };
  CHECK(bent(1) != bent(-1));
}

}  // namespace
}  // namespace torquer::test
