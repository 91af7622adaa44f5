// A wire in a catheter against closed forms.
#include <catch2/catch.hpp>

#include "host/simulator/core/coaxial/coaxial_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kSegment = 0.5;

// A wire that rests as an arc, and a catheter, both in free space.
struct Pair {
  CoaxialPair pair;
  FreeSpace field;
  WallModel wall;
  std::vector<EnergyTerm*> none;
  CoaxialRelaxation relaxation;
  WireState state;

  Pair(double wire_rigidity, double wire_curvature, double catheter_rigidity,
       double catheter_curvature)
      : pair(Arc(wire_rigidity, wire_curvature, 0.2),
             Arc(catheter_rigidity, catheter_curvature, 0.6)),
        relaxation(pair, {}, {}, field, wall, {.tolerance = 1e-9}, none),
        state(pair.rod()) {
    relaxation.Restart(state);
  }
  static WireModel Arc(double rigidity, double curvature, double radius) {
    return WireModel(kSegment, {{0, rigidity, radius, curvature, 0}}, 0, 80, BendingLaw::kExact,
                     {});
  }
  void MoveTo(const HandTarget& target) {
    const TickReport report = Settle(relaxation, target, state, 400);
    REQUIRE(report.converged);
    REQUIRE(report.carried_mm == 0);
    REQUIRE_FALSE(report.budget_spent);
  }
  /// Bend per length between two segments about half a segment either side of an arc length, as a
  /// vector across.
  Vector3d CurvatureAt(double s_mm) const {
    const int n = state.segments();
    const int joint =
        n - static_cast<int>(std::lround((state.ArcLength(pair.rod()) - s_mm) / kSegment));
    return (state.tangents[joint] - state.tangents[joint - 1]) / kSegment;
  }
};

TEST_CASE("A wire in a catheter bends as the sum of both would: the combined curvature") {
  Pair both(2, 0.04, 3, 0.01);
  both.MoveTo({60, 0, 35, 0});
  CHECK(both.CurvatureAt(20).norm() == Approx((2 * 0.04 + 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(30).norm() == Approx((2 * 0.04 + 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(50).norm() == Approx(0.04).epsilon(1e-3));
  // Turned against each other by a right angle, the curvatures add up as vectors.
  both.MoveTo({60, 0, 35, 1.5707963267948966});
  CHECK(both.CurvatureAt(20).norm() == Approx(std::hypot(2 * 0.04, 3 * 0.01) / 5).epsilon(1e-3));
  CHECK(both.CurvatureAt(50).norm() == Approx(0.04).epsilon(1e-3));
}

TEST_CASE("A stiff catheter straightens a soft bent wire, which takes its shape again without it") {
  Pair both(0.01, 0.05, 100, 0);
  both.MoveTo({60, 0, 0, 0});
  const WireState alone = both.state;
  CHECK(both.CurvatureAt(30).norm() == Approx(0.05).epsilon(1e-3));
  both.MoveTo({60, 0, 60, 0});
  CHECK(both.CurvatureAt(30).norm() < 1e-4);
  CHECK(both.state.nodes.back()[0] == Approx(60).epsilon(1e-4));
  both.MoveTo({60, 0, 0, 0});
  CHECK(LargestDistance(both.state, alone) < 1e-5);
}

TEST_CASE("Whichever goes on beyond the other leads, and nothing jumps where the tips pass") {
  Pair both(2, 0.04, 3, 0.01);
  both.MoveTo({30, 0, 25, 0});
  Vector3d before = both.state.nodes.back();
  for (double catheter = 25; catheter <= 35.001; catheter += 0.1) {
    both.MoveTo({30, 0, catheter, 0});
    // The tip goes on with the catheter once that leads; else it is only bent.
    CHECK((both.state.nodes.back() - before).norm() < 0.2);
    before = both.state.nodes.back();
  }
  CHECK(both.state.insertion_mm == Approx(35));
  CHECK(both.pair.wire_place().insertion_mm == 30);
  CHECK(both.CurvatureAt(33).norm() == Approx(0.01).epsilon(1e-3));
  const WireState led = both.state;
  // The wire back and forth within it ends where it began.
  both.MoveTo({5, 0, 35, 0});
  CHECK(both.CurvatureAt(20).norm() == Approx(0.01).epsilon(1e-3));
  both.MoveTo({30, 0, 35.001, 0});
  both.MoveTo({30, 0, 35, 0});
  CHECK(LargestDistance(both.state, led) < 1e-3);
}

TEST_CASE("The wall sees the catheter where there is one") {
  Pair both(2, 0, 3, 0);
  both.MoveTo({40, 0, 20, 0});
  const WireModel& rod = both.pair.rod();
  CHECK(rod.radius_mm(0) == 0.2);
  CHECK(rod.radius_mm(79) == 0.6);
  CHECK(rod.rigidity_N_mm2(0) == 2);
  CHECK(rod.rigidity_N_mm2(79) == Approx(5));
  both.MoveTo({10, 0, 20, 0});
  CHECK(rod.radius_mm(0) == 0.6);
  CHECK(rod.rigidity_N_mm2(0) == 3);
  CHECK(rod.rigidity_N_mm2(39) == Approx(5));
}

// Notes how surfaces slid.
class SlideRecorder final : public EnergyTerm {
 public:
  void Begin(const PointSet&) override {}
  double Add(const PointSet&, PointDerivatives&) const override { return 0; }
  void SlideSurface(const PointSet& points, int last, double by_mm) override {
    slid_mm += by_mm;
    bare_points = points.size() - 1 - last;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

  double slid_mm = 0;
  int bare_points = -1;
};

TEST_CASE("The surface of the catheter goes with the catheter, whoever leads") {
  SlideRecorder recorder;
  const std::vector<EnergyTerm*> terms{&recorder};
  CoaxialPair pair(Pair::Arc(2, 0, 0.2), Pair::Arc(3, 0, 0.6));
  const FreeSpace field;
  const WallModel wall;  // two contact points a segment of 0.5 mm
  CoaxialRelaxation relaxation(pair, {40, 0}, {25, 0}, field, wall, {}, terms);
  WireState state = LayStraight(pair.rod(), 40);
  relaxation.Restart(state);
  const auto slid = [&](const HandTarget& target) {
    recorder.slid_mm = 0;
    REQUIRE(Settle(relaxation, target, state).converged);
    return recorder.slid_mm;
  };
  CHECK(slid({42, 0, 25, 0}) == Approx(-2));  // the rod went on, the catheter stayed
  CHECK(recorder.bare_points >= 66);          // 16.5 mm and more of it is wire alone
  CHECK(recorder.bare_points <= 68);
  CHECK(slid({42, 0, 28, 0}) == Approx(3));                // the rod stayed, the catheter went on
  CHECK(slid({45, 0, 31, 0}) == Approx(0).margin(1e-12));  // together
  // The catheter passes the wire's tip after 14 mm, and then is the rod.
  CHECK(slid({45, 0, 50, 0}) == Approx(14));
  CHECK(slid({20, 0, 50, 0}) == Approx(0).margin(1e-12));  // the wire within it
}

TEST_CASE("A bend of the catheter comes to joints that were straight, and turns with it") {
  Pair both(2, 0, 50, 0.02);
  both.MoveTo({60, 0, 5, 0});
  both.MoveTo({60, 0.8, 40, 0.8});
  const Vector3d bend = both.CurvatureAt(20);
  CHECK(bend.norm() == Approx(50 * 0.02 / 52).epsilon(1e-3));
  both.MoveTo({60, 0.8, 40, 0.8 + 1.5707963267948966});
  CHECK(std::abs(both.CurvatureAt(20).normalized().dot(bend.normalized())) < 0.3);
}

TEST_CASE("Any budget leaves a whole rod, and the same work gives the same bits") {
  Pair a(2, 0.04, 3, 0.01);
  Pair b(2, 0.04, 3, 0.01);
  std::vector<int> work;
  const auto target = [](int k) { return HandTarget{0.3 * k, 0.02 * k, 0.2 * k, -0.01 * k}; };
  for (int k = 1; k <= 150; ++k) {
    CountedBudget budget(k % 4);
    work.push_back(a.relaxation.Tick(target(k), budget, a.state).work);
    CHECK(work.back() <= k % 4);
  }
  for (int k = 1; k <= 150; ++k) {
    CountedBudget budget(work[static_cast<std::size_t>(k - 1)]);
    b.relaxation.Tick(target(k), budget, b.state);
  }
  CHECK(HashState(a.state) == HashState(b.state));
  a.MoveTo(target(150));
  CHECK(a.state.ArcLength(a.pair.rod()) == Approx(45));
}

TEST_CASE("Instruments that do not fit together are refused") {
  const auto wire = [](double segment, double torsional) {
    return MakeWire({.segment_mm = segment, .torsional_rigidity_N_mm2 = torsional});
  };
  CHECK_THROWS_AS(CoaxialPair(wire(1, 0), wire(0.5, 0)), std::invalid_argument);
  CHECK_THROWS_AS(CoaxialPair(wire(1, 1), wire(1, 0)), std::invalid_argument);
}

}  // namespace
}  // namespace torquer::test
