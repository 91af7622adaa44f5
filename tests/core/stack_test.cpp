// Nested instruments, compared with closed forms.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/free_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kRightAngle = 1.5707963267948966;

struct Arcs : FreeStack {
  using FreeStack::FreeStack;
  /// Curvature vector in 1/mm, from the bend between two segments. They lie about half a segment on
  /// either side of the arc length.
  Vector3d CurvatureAt(double s_mm) const {
    const int n = state.segments();
    const int joint =
        n -
        static_cast<int>(std::lround((state.ArcLength(stack.empty_rod()) - s_mm) / kArcSegmentMm));
    const auto k = static_cast<std::size_t>(joint);
    return (state.tangents()[k] - state.tangents()[k - 1]) / kArcSegmentMm;
  }
};

TEST_CASE("A wire in a catheter bends as the sum of both would: the combined curvature") {
  Arcs both({Arc(2, 0.04, 0.2), Arc(3, 0.01, 0.6)});
  both.MoveTo({{60, 0}, {35, 0}});
  CHECK(both.CurvatureAt(20).norm() == Approx((2 * 0.04 + 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(30).norm() == Approx((2 * 0.04 + 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(50).norm() == Approx(0.04).epsilon(1e-3));
  // With a relative rotation by a right angle, the curvatures add as vectors.
  both.MoveTo({{60, 0}, {35, kRightAngle}});
  CHECK(both.CurvatureAt(20).norm() == Approx(std::hypot(2 * 0.04, 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(50).norm() == Approx(0.04).epsilon(1e-3));
}

TEST_CASE("Three and four instruments bend as the sum of all that are there") {
  Arcs all({Arc(2, 0.04, 0.2), Arc(3, 0.01, 0.6), Arc(5, -0.02, 0.9), Arc(10, 0.005, 1.2)});
  all.MoveTo({{70, 0}, {50, 0}, {35, 0}, {15, 0}});
  CHECK(all.CurvatureAt(60).norm() == Approx(0.04).epsilon(1e-3));
  CHECK(all.CurvatureAt(42).norm() == Approx(0.11 / 5).epsilon(1e-3));
  CHECK(all.CurvatureAt(25).norm() == Approx(0.01 / 10).epsilon(1e-2));
  CHECK(all.CurvatureAt(8).norm() == Approx((0.11 - 0.1 + 0.05) / 20).epsilon(1e-2));
  // The order of arrival must not matter.
  const WireState at_once = all.state;
  all.MoveTo({{20, 0}, {50, 0}, {60, 0}, {0, 0}});
  all.MoveTo({{70, 0}, {50, 0}, {35, 0}, {15, 0}});
  CHECK(LargestDistance(all.state, at_once) < 1e-3);
}

TEST_CASE("A stiff catheter straightens a soft bent wire, which takes its shape again without it") {
  Arcs both({Arc(0.01, 0.05, 0.2), Arc(100, 0, 0.6)});
  both.MoveTo({{60, 0}, {0, 0}});
  const WireState alone = both.state;
  CHECK(both.CurvatureAt(30).norm() == Approx(0.05).epsilon(1e-3));
  both.MoveTo({{60, 0}, {60, 0}});
  CHECK(both.CurvatureAt(30).norm() < 1e-4);
  CHECK(both.state.tip()[0] == Approx(60).epsilon(1e-4));
  both.MoveTo({{60, 0}, {0, 0}});
  CHECK(LargestDistance(both.state, alone) < 1e-5);
}

TEST_CASE(
    "The instrument that reaches farther leads, and the shape is continuous where tips pass") {
  Arcs both({Arc(2, 0.04, 0.2), Arc(3, 0.01, 0.6)});
  both.MoveTo({{30, 0}, {25, 0}});
  Vector3d before = both.state.tip();
  for (double catheter = 25; catheter <= 35.001; catheter += 0.1) {
    both.MoveTo({{30, 0}, {catheter, 0}});
    // The tip advances with the catheter once that leads; until then it is only bent.
    CHECK((both.state.tip() - before).norm() < 0.2);
    before = both.state.tip();
  }
  CHECK(both.state.insertion_mm() == Approx(35));
  CHECK(both.state.poses()[0].insertion_mm == 30);
  CHECK(both.CurvatureAt(33).norm() == Approx(0.01).epsilon(1e-3));
  const WireState led = both.state;
  // A wire that moves back and forth inside returns to the same shape.
  both.MoveTo({{5, 0}, {35, 0}});
  CHECK(both.CurvatureAt(20).norm() == Approx(0.01).epsilon(1e-3));
  both.MoveTo({{30, 0}, {35.001, 0}});
  both.MoveTo({{30, 0}, {35, 0}});
  CHECK(LargestDistance(both.state, led) < 1e-3);
}

TEST_CASE("Two instruments with flush tips press on a wall as one with both rigidities does") {
  const HalfSpace floor(Vector3d(0, -2, 0), Vector3d::UnitY());
  const WallModel wall;
  EndForce force(Vector3d(0, -0.02, 0));
  const std::vector<EnergyTerm*> terms{&force};
  const auto pressed = [&](const InstrumentStack& stack, const InstrumentPoses& at) {
    const auto relaxation = MakeNewtonRelaxation(stack, floor, wall, {.tolerance = 1e-9}, terms);
    WireState state(stack.empty_rod(), stack.size());
    relaxation->Restart(state);
    REQUIRE(Settle(*relaxation, at, state, 400).converged);
    return state;
  };
  InstrumentStack nested({Arc(2, 0, 0.2), Arc(3, 0, 0.6)});
  const WireModel sum = Arc(5, 0, 0.6);
  InstrumentStack one(sum);
  const WireState both = pressed(nested, {{30, 0}, {30, 0}});
  CHECK(LargestDistance(both, pressed(one, {30, 0})) < 1e-9);
  CHECK(both.tip()[1] == Approx(-2 + 0.6).margin(0.1));  // its surface is on the floor
}

TEST_CASE("An instrument that ends at the sheath has no part in the shape") {
  Arcs alone({Arc(2, 0.04, 0.2)});
  alone.MoveTo({60, 0});
  Arcs both({Arc(2, 0.04, 0.2), Arc(300, 0, 0.6)});
  both.MoveTo({{60, 0}, {0, 0}});
  CHECK(LargestDistance(both.state, alone.state) < 1e-9);
  // The bend of the first joint is a mean of the curvature. Its weight falls from 1 at the sheath
  // to 0 at the next joint. A catheter that covers the part d/l of this length has (d/l)(2 - d/l)
  // of the weight.
  const InstrumentStack stack({Arc(1, 0, 0.2), Arc(9, 0, 0.6)});
  CombinedRods rods(stack);
  for (const double part : {0.0, 0.1, 0.5, 1.0}) {
    CAPTURE(part);
    rods.Combine({{60, 0}, {part * kArcSegmentMm, 0}});
    const double weight = part * (2 - part);
    const int first_joint = static_cast<int>(std::lround(60 / kArcSegmentMm));
    CHECK(rods[0].rigidity_N_mm2(first_joint) ==
          Approx(1 / (1 - weight + weight / 10)).epsilon(1e-12));
  }
}

TEST_CASE("The wall sees the outermost instrument that is there") {
  Arcs all({Arc(2, 0, 0.2), Arc(3, 0, 0.6), Arc(7, 0, 0.9)});
  all.MoveTo({{40, 0}, {20, 0}, {10, 0}});
  const WireModel& rod = all.relaxation->rods()[0];
  CHECK(rod.radius_mm(0) == 0.2);
  CHECK(rod.radius_mm(55) == 0.6);
  CHECK(rod.radius_mm(79) == 0.9);
  CHECK(rod.rigidity_N_mm2(0) == 2);
  CHECK(rod.rigidity_N_mm2(55) == Approx(5));
  CHECK(rod.rigidity_N_mm2(79) == Approx(12));
  all.MoveTo({{10, 0}, {20, 0}, {0, 0}});
  CHECK(rod.radius_mm(0) == 0.6);
  CHECK(rod.rigidity_N_mm2(0) == 3);
  CHECK(rod.rigidity_N_mm2(39) == Approx(5));
}

TEST_CASE("Each instrument at the wall presses by its own length, wherever the tips are") {
  constexpr std::array<double, 3> kRadiusMm = {0.2, 0.5, 0.8};
  constexpr double kPerMm = 2;  // N/mm^2
  const double clearance_mm = GENERATE(0.1, 0.3, 0.6, 0.9);
  const int points = GENERATE(1, 2, 3);
  // Straight instruments along the wall of a straight tube.
  const Cylinder tube(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 3);
  const Sheath sheath{Vector3d(0, 3 - clearance_mm, 0), Vector3d::UnitX()};
  const WallModel wall{.stiffness_N_mm2 = kPerMm, .points_per_segment = points};
  std::vector<WireModel> instruments;
  for (const double radius_mm : kRadiusMm) {
    instruments.push_back(
        MakeWire({.radius_mm = radius_mm, .max_length_mm = 40, .sheath = sheath}));
  }
  const InstrumentStack stack(instruments);
  CombinedRods rods(stack);
  const std::vector<EnergyTerm*> none;
  WireMechanics mechanics(rods, tube, wall, none);
  QuadraticModel at = mechanics.MakeQuadraticModel();
  std::mt19937 random(7);
  std::uniform_real_distribution<double> insertion(3, 20);
  for (int round = 0; round < 60; ++round) {
    InstrumentPoses poses(3);
    for (int k = 0; k < 3; ++k) poses[k].insertion_mm = insertion(random);
    // Tips of one half of the rounds share a segment, or the piece of a contact point.
    if (round % 2 == 0) poses[1].insertion_mm = poses[0].insertion_mm - 0.1 * (round % 8);
    if (round % 3 == 0) poses[2].insertion_mm = poses[1].insertion_mm - 0.1;
    CAPTURE(clearance_mm, points, poses[0].insertion_mm, poses[1].insertion_mm,
            poses[2].insertion_mm);
    rods.Combine(poses);
    const WireState state = WireState::Along(rods[0], {}, poses);
    mechanics.BuildModel(state, at);
    double energy_mJ = 0;
    double force_N = 0;
    double begin_mm = at.points.first_spacing_mm / 2;  // the sheath has the first half piece
    for (int k = 2; k >= 0; --k) {
      const double length_mm = std::max(0.0, poses[k].insertion_mm - begin_mm);
      const double depth_mm = std::max(0.0, kRadiusMm[k] - clearance_mm);
      energy_mJ += kPerMm * length_mm * depth_mm * depth_mm / 2;
      force_N += kPerMm * length_mm * depth_mm;
      begin_mm += length_mm;
    }
    CHECK(at.energy_mJ == Approx(energy_mJ).epsilon(1e-9).margin(1e-12));
    double pressed_N = 0;
    for (const WallSpring& spring : at.springs) pressed_N += spring.ContactForceN();
    CHECK(pressed_N == Approx(force_N).epsilon(1e-9).margin(1e-12));
  }
}

// Records how surfaces slid.
class SlideRecorder final : public EnergyTerm, public ContactTerm {
 public:
  void Begin(const PointSet&) override {}
  double Add(const PointSet&, PointDerivatives&) const override { return 0; }
  ContactTerm* contact_term() override { return this; }
  bool ActsOnWall() const override { return false; }
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override {
    for (std::size_t k = 0; k < slid_mm.size(); ++k) slid_mm[k] += moves[k].along_mm;
    bare_points = 0;
    for (int q = 0; q < points.size(); ++q) bare_points += points.SurfaceAt(q) == 0;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

  std::array<double, kMostInstruments> slid_mm = {};
  int bare_points = -1;
};

TEST_CASE("The surface of each instrument moves with that instrument, for any leader") {
  SlideRecorder recorder;
  const std::vector<EnergyTerm*> terms{&recorder};
  InstrumentStack stack({Arc(2, 0, 0.2), Arc(3, 0, 0.6)});
  const FreeSpace field;
  const WallModel wall;  // two contact points a segment of 0.5 mm
  const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {}, terms);
  WireState state = WireState::Along(stack.empty_rod(), {}, {{40, 0}, {25, 0}});
  relaxation->Restart(state);
  const auto slid = [&](const InstrumentPoses& target, std::size_t instrument) {
    recorder.slid_mm = {};
    REQUIRE(Settle(*relaxation, target, state).converged);
    return recorder.slid_mm[instrument];
  };
  CHECK(slid({{42, 0}, {25, 0}}, 1) == Approx(-2));  // the rod advanced, the catheter stayed
  CHECK(recorder.bare_points >= 66);                 // at least 16.5 mm is wire alone
  CHECK(recorder.bare_points <= 68);
  CHECK(slid({{42, 0}, {28, 0}}, 1) == Approx(3));  // the rod stayed, the catheter advanced
  CHECK(slid({{45, 0}, {31, 0}}, 1) == Approx(0).margin(1e-12));  // together
  // The catheter passes the wire's tip after 14 mm; from there its material belongs to the rod.
  CHECK(slid({{45, 0}, {50, 0}}, 1) == Approx(14));
  CHECK(slid({{20, 0}, {50, 0}}, 1) == Approx(0).margin(1e-12));  // the wire inside the catheter
}

TEST_CASE("A bend of the catheter moves to straight joints, and turns with it") {
  Arcs both({Arc(2, 0, 0.2), Arc(50, 0.02, 0.6)});
  both.MoveTo({{60, 0}, {5, 0}});
  both.MoveTo({{60, 0.8}, {40, 0.8}});
  const Vector3d bend = both.CurvatureAt(20);
  CHECK(bend.norm() == Approx(50 * 0.02 / 52).epsilon(1e-3));
  both.MoveTo({{60, 0.8}, {40, 0.8 + kRightAngle}});
  CHECK(std::abs(both.CurvatureAt(20).normalized().dot(bend.normalized())) < 0.3);
}

TEST_CASE("Any budget leaves a whole rod and no heap, and the same work gives the same bits") {
  const double torsional_N_mm2 = GENERATE(0.0, 1.5);
  const auto make = [&] {
    return std::vector<WireModel>{Arc(2, 0.04, 0.2, torsional_N_mm2),
                                  Arc(3, 0.01, 0.6, 2 * torsional_N_mm2)};
  };
  Arcs a(make());
  Arcs b(make());
  std::vector<int> work;
  work.reserve(150);
  const std::size_t allocated = AllocationCount();
  const auto target = [](int k) {
    return InstrumentPoses{{0.3 * k, 0.02 * k}, {0.2 * k, -0.01 * k}};
  };
  for (int k = 1; k <= 150; ++k) {
    CountedBudget budget(k % 4);
    work.push_back(a.relaxation->Tick(target(k), budget, a.state).work);
    if (work.back() > k % 4) FAIL("work beyond its budget");
  }
  CHECK(AllocationCount() == allocated);
  for (int k = 1; k <= 150; ++k) {
    CountedBudget budget(work[static_cast<std::size_t>(k - 1)]);
    b.relaxation->Tick(target(k), budget, b.state);
  }
  CHECK(HashState(a.state) == HashState(b.state));
  a.MoveTo(target(150));
  CHECK(a.state.ArcLength(a.stack.empty_rod()) == Approx(45));
}

TEST_CASE("Instruments that do not fit together are refused") {
  const auto stack = [](double segment_mm, double torsional_N_mm2) {
    return InstrumentStack(std::vector<WireModel>{
        MakeWire({}),
        MakeWire({.segment_mm = segment_mm, .torsional_rigidity_N_mm2 = torsional_N_mm2})});
  };
  CHECK_NOTHROW(stack(1, 0));
  CHECK_THROWS_AS(stack(0.5, 0), std::invalid_argument);
  CHECK_THROWS_AS(stack(1, 1), std::invalid_argument);
  CHECK_THROWS_AS(InstrumentStack(std::vector<WireModel>{}), std::invalid_argument);
  CHECK_THROWS_AS(InstrumentStack(std::vector<WireModel>(5, MakeWire({}))), std::invalid_argument);
}

}  // namespace
}  // namespace torquer::test
