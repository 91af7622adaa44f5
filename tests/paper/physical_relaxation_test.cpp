// Section 3.1 of Baier et al. 2016: updates, cycles, Tip Relaxation.
#include "host/simulator/core/paper/physical_relaxation.h"

#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

const std::vector<EnergyTerm*> kNoTerms;
constexpr double kUnbounded = std::numeric_limits<double>::infinity();

PhysicalSettings With(UpdateRule rule, double max_update) {
  PhysicalSettings settings;
  settings.rule = rule;
  settings.max_update = max_update;
  return settings;
}

// A sinuous channel along x. A wire in it touches the wall everywhere, because its curvature has to
// change everywhere.
class WavyChannel final : public AnalyticField {
 public:
  void EvaluateHessian(const Vector3d& p, ClearanceSample& out) const override {
    const double f = kHeight * (1 - std::cos(kWave * p[0]));
    const double slope = kHeight * kWave * std::sin(kWave * p[0]);
    const double curvature = kHeight * kWave * kWave * std::cos(kWave * p[0]);
    const Vector3d h(-slope, 1, 0);  // gradient of the height above the axis
    const double height = p[1] - f;
    const double d = std::max(std::hypot(height, p[2]), 1e-9);
    const Vector3d g = (height * h + p[2] * Vector3d::UnitZ()) / d;
    out.clearance_mm = 0.3 - d;
    out.gradient = -g;
    Matrix3d hessian = h * h.transpose() - g * g.transpose();
    hessian(2, 2) += 1;
    hessian(0, 0) -= height * curvature;
    out.hessian = -hessian / d;
  }
  double LipschitzBound() const override { return std::hypot(1, kHeight * kWave); }

 private:
  static constexpr double kHeight = 2;
  static constexpr double kWave = 2 * M_PI / 30;
};

// A wire at equilibrium in that channel.
struct ChannelCase {
  explicit ChannelCase(double stiffness_N_mm2)
      : model(MakeWire({.max_length_mm = 100})), wall{stiffness_N_mm2, 1}, state(model) {
    state = WireState::Along(model, {{100, 0, 0}}, {60, 0});
    NewtonSettings settings;
    settings.tolerance = 1e-9;
    NewtonRelaxation newton(model, field, wall, settings, kNoTerms);
    newton.Restart(state);
    REQUIRE(Settle(newton, {60, 0}, state).converged);
    for (const std::uint8_t touches : newton.Current().points.touches) contacts += touches;
  }
  WavyChannel field;
  WireModel model;
  WallModel wall;
  WireState state;
  int contacts = 0;
};

// Distance in mm by which `cycles` of PR move the equilibrium of a case.
double Drift(ChannelCase& c, int cycles) {
  const WireState before = c.state;
  PhysicalRelaxation physical(c.model, c.field, c.wall, {});
  physical.Restart(c.state);
  for (int k = 0; k < cycles; ++k) {
    REQUIRE(physical.ContinueCycle(1'000'000, c.state));
  }
  return LargestDistance(before, c.state);
}

}  // namespace

TEST_CASE("an update follows the energy's gradient across the segment: (6) to (10'), (17)") {
  const BendingLaw law = GENERATE(BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2);
  const double stiffness = GENERATE(1e-6, 3e-4);
  // Rigidity decreases towards the tip, and the wire leans into a wall.
  const WireModel model(0.5, {{0, 2e-3, 0.2, 0, 0}, {15, 8e-3, 0.3, 0, 0}}, 0, 30, law,
                        {{0, 0.3, 0}, {1, 0, 0}});
  const HalfSpace field({0, 0, 0}, {0, 1, 0});
  const WallModel wall{stiffness, 1};
  std::mt19937 random(1);
  WireState state = Wander(model, 20, 0.2, random);
  WireMechanics mechanics(model, field, wall, kNoTerms);
  QuadraticModel quadratic = mechanics.MakeQuadraticModel();
  mechanics.BuildGradient(state, quadratic);
  REQUIRE(quadratic.max_penetration_mm > 0);

  for (const int i : {0, 1, 17, 38, 39}) {
    CAPTURE(i);
    WireState moved = state;
    PhysicalRelaxation physical(model, field, wall, With(UpdateRule::kRhoOnly, kUnbounded));
    physical.Restart(moved);
    physical.Update(i, moved);
    const Vector3d& u = state.tangents()[i];
    const Vector3d du = moved.tangents()[i] / moved.tangents()[i].dot(u) - u;
    // (8), (10'): rho from the bends on either side.
    const auto joint = [&](int k) {
      const Vector3d before = k == 0 ? model.sheath().direction : state.tangents()[k - 1];
      return JointStiffness(model, state, k) *
             EvaluateBending(law, 1 - before.dot(state.tangents()[k])).slope;
    };
    const double length = state.SegmentLength(model, i);
    const double rho = (joint(i) + (i + 1 < 40 ? joint(i + 1) : 0)) / length;
    const Vector2d across(state.normals()[i].dot(du), u.cross(state.normals()[i]).dot(du));
    CHECK((-rho * length * across - quadratic.gradient[i]).norm() <
          1e-9 * std::max(1e-5, quadratic.gradient[i].norm()));
  }
}

TEST_CASE("the ladder of update rules: (16), (17), (19), exact root") {
  const WireModel model = MakeWire({.max_length_mm = 20});
  // Head-on, slightly oblique: the wall's force acts mainly along the last segment.
  WireState start = WithTangent(model, LayStraight(model, 10), 9, Vector3d(1, 0.02, 0));
  const double pressed = GENERATE(0.01, 2.0);  // mm
  CAPTURE(pressed);
  const HalfSpace field({start.nodes()[10][0] + 0.178 - pressed, 0, 0}, {-1, 0, 0});
  const WallModel wall{0.2, 1};  // 0.1 N/mm at the end, which stands for half a segment
  // B of (10') by hand: u_{n+1} does not exist, p of (8) is about 1.
  const Vector3d u = start.tangents()[9];
  const Vector3d eta = start.tangents()[8] - u;
  const double c = JointStiffness(model, start, 9);
  const double p = EvaluateBending(BendingLaw::kExact, 1 - u.dot(start.tangents()[8])).slope;
  const Vector3d force = Vector3d(0.1 * pressed, 0, 0) - c * p * eta;
  const double along = force.dot(u);
  const double across = (force - along * u).norm();
  const double rho = c * p;
  CHECK((rho - along < 0) == (pressed > 1));

  const auto step = [&](UpdateRule rule, double* turned_away = nullptr) {
    WireState state = start;
    PhysicalRelaxation physical(model, field, wall, With(rule, kUnbounded));
    physical.Restart(state);
    const double du = physical.Update(9, state);
    if (turned_away != nullptr) *turned_away = start.nodes()[10][0] - state.nodes()[10][0];
    return du;
  };
  double away = 0;
  CHECK(step(UpdateRule::kRhoOnly) == Approx(across / rho));
  CHECK(step(UpdateRule::kSigned, &away) == Approx(across / std::abs(rho - along)));
  // With the predecessor's sign, a strongly pressed tip turns further into the wall.
  if (pressed > 1) CHECK(away < 0);
  CHECK(step(UpdateRule::kAbsolute, &away) == Approx(across / std::abs(rho - along)));
  if (pressed > 1) CHECK(away > 0);
  // The equation before (19), with a = -lambda |du|.
  const double a = -step(UpdateRule::kExactRoot, &away);
  if (pressed > 1) CHECK(away > 0);
  CHECK(-a * (along - rho) + (2 - a * a) / std::sqrt(4 - a * a) * across ==
        Approx(0).margin(1e-12));
}

TEST_CASE("an update is bounded by du_max / sqrt(n + 1 - i): (18)") {
  const WireModel model = MakeWire({.max_length_mm = 40});
  const FreeSpace field;
  const WallModel wall{1, 1};
  std::mt19937 random(3);
  const WireState start = Wander(model, 30, 0.5, random);
  int bounded = 0;
  for (int i = 0; i < 30; ++i) {
    WireState state = start;
    PhysicalRelaxation physical(model, field, wall, With(UpdateRule::kAbsolute, 0.1));
    physical.Restart(state);
    const double bound = 0.1 / std::sqrt(30.0 - i);
    const double du = physical.Update(i, state);
    CHECK(du <= bound);
    bounded += du == bound;
    CHECK((state.tangents()[i] - start.tangents()[i]).norm() <= bound);
  }
  CHECK(bounded > 10);
}

TEST_CASE("an update moves only the distal part, rigidly") {
  const WireModel model =
      MakeWire({.tip_mm = 6, .tip_curvature_1_per_mm = 0.1, .max_length_mm = 40});
  const FreeSpace field;
  const WallModel wall{1, 1};
  std::mt19937 random(4);
  const WireState start = Wander(model, 30, 0.2, random);
  WireState state = start;
  PhysicalRelaxation physical(model, field, wall, {});
  physical.Restart(state);
  physical.Update(12, state);
  const Vector3d move = state.nodes()[30] - start.nodes()[30];
  CHECK(move.norm() > 1e-4);
  for (int j = 0; j <= 30; ++j) {
    CHECK((state.nodes()[j] - start.nodes()[j] - (j > 12 ? move : Vector3d::Zero())).norm() <
          1e-12);
  }
  CHECK(std::abs(state.tangents()[12].norm() - 1) < 1e-15);
  // The updated spin equals the recomputed one: the tip's rest shape does not twist.
  WireState again = state;
  again.UpdateFrames(model);
  for (std::size_t k = 0; k < state.reference_twist().size(); ++k) {
    CHECK((again.reference_twist()[k] - state.reference_twist()[k]).norm() < 1e-12);
  }
}

TEST_CASE("a cycle is n(n+1)/2 updates, however it is cut") {
  const WireModel model = MakeWire({.max_length_mm = 40});
  const Torus field(Side::kInside, 20, 2);
  const WallModel wall{0.01, 1};
  std::mt19937 random(5);
  const WireState start = Wander(model, 30, 0.1, random);
  WireState whole = start;
  PhysicalRelaxation one(model, field, wall, {});
  one.Restart(whole);
  CHECK(one.ContinueCycle(1'000'000, whole));
  CHECK(one.updates() == 30 * 31 / 2);

  WireState cut = start;
  PhysicalRelaxation two(model, field, wall, {});
  two.Restart(cut);
  int slices = 1;
  while (!two.ContinueCycle(37, cut)) ++slices;
  CHECK(slices == (465 + 36) / 37);
  CHECK(HashState(cut) == HashState(whole));
}

TEST_CASE("an incomplete cycle leaves out its last iterations") {
  const WireModel model = MakeWire({.max_length_mm = 40});
  const FreeSpace field;
  const WallModel wall{1, 1};
  std::mt19937 random(6);
  const WireState start = Wander(model, 30, 0.1, random);
  WireState state = start;
  PhysicalSettings settings;
  settings.cycle_fraction = 0.4;
  PhysicalRelaxation physical(model, field, wall, settings);
  physical.Restart(state);
  CHECK(physical.ContinueCycle(1'000'000, state));
  CHECK(physical.updates() == 12 * 13 / 2);
  for (int i = 0; i < 30; ++i) {
    CHECK((state.tangents()[i] == start.tangents()[i]) == (i < 18));
  }
}

TEST_CASE("Tip Relaxation updates the tip fully and every margin-th segment once") {
  const int margin = GENERATE(3, 5);
  const WireModel model = MakeWire({.tip_mm = 4, .max_length_mm = 60});
  const FreeSpace field;
  const WallModel wall{1, 1};
  std::mt19937 random(7);
  const WireState start = Wander(model, 40, 0.1, random);
  WireState state = start;
  PhysicalSettings settings;
  settings.margin = margin;
  PhysicalRelaxation physical(model, field, wall, settings);
  physical.Restart(state);
  physical.RelaxTip(state);
  const int m = 4 + margin;
  CHECK(physical.TipIterations(state) == m);
  CHECK(physical.updates() == m * (m + 1) / 2 + (40 - m - 1) / margin);
  for (int i = 0; i < 40; ++i) {
    const int paper = i + 1;  // the paper counts segments from 1
    const bool tip = paper > 40 - m;
    const bool single = paper < 40 - m && (40 - m - paper) % margin == 0;
    CHECK((state.tangents()[i] != start.tangents()[i]) == (tip || single));
  }
}

TEST_CASE("skipped look-ups change no bit") {
  const Torus field(Side::kInside, 20, 2);
  const WireModel model = MakeWire({.tip_mm = 5,
                                    .tip_curvature_1_per_mm = 0.1,
                                    .max_length_mm = 60,
                                    .sheath = {{20, 0, 0}, {0, 1, 0}}});
  const WallModel wall{0.05, 1};
  std::vector<Vector3d> path;
  for (int k = 1; k <= 50; ++k) {
    path.emplace_back(20 * std::cos(0.05 * k), 20 * std::sin(0.05 * k), 0);
  }
  WireState start = WireState::Along(model, path, {50, 0});
  std::mt19937 random(8);
  Shake(model, 0.02, random, start);
  std::uint64_t hash[2];
  std::int64_t lookups[2];
  for (const bool skip : {false, true}) {
    WireState state = start;
    PhysicalSettings settings;
    settings.skip_lookups = skip;
    PhysicalRelaxation physical(model, field, wall, settings);
    physical.Restart(state);
    physical.RelaxTip(state);
    CHECK(physical.ContinueCycle(1'000'000, state));
    hash[skip] = HashState(state);
    lookups[skip] = physical.lookups();
  }
  CHECK(hash[0] == hash[1]);
  CHECK(lookups[1] < lookups[0] / 2);
}

TEST_CASE("without a wall cycles bend the tip to its rest shape, for any rotation: (5)") {
  const double rotation = GENERATE(0.0, 1.0, -2.5);
  const WireModel model =
      MakeWire({.tip_mm = 4, .tip_curvature_1_per_mm = 0.15, .max_length_mm = 40});
  const FreeSpace field;
  const WallModel wall{1, 1};
  WireState state = LayStraight(model, 10);
  state.Rotate(rotation);
  PhysicalRelaxation physical(model, field, wall, {});
  physical.Restart(state);
  for (int k = 0; k < 300; ++k) CHECK(physical.ContinueCycle(1'000'000, state));
  for (int i = 0; i < 10; ++i) {
    CHECK((state.tangents()[i] - RestDirection(model, state, i)).norm() < 1e-5);
  }
  // Three joints have a rest bend of 0.15 rad. The joint at the tip's proximal end has half of it.
  // The bend points along the sheath's first normal, turned by the rotation.
  const Vector3d& axis = model.sheath().direction;
  const Vector3d& first = model.sheath_normal();
  const Vector3d way = std::cos(rotation) * first + std::sin(rotation) * axis.cross(first);
  CHECK((state.tangents()[9] - std::cos(0.525) * axis - std::sin(0.525) * way).norm() < 1e-4);
}

TEST_CASE("without a wall cycles straighten the wire") {
  const WireModel model = MakeWire({.max_length_mm = 40});
  const FreeSpace field;
  const WallModel wall{1, 1};
  std::mt19937 random(9);
  WireState state = Wander(model, 12, 0.1, random);
  PhysicalRelaxation physical(model, field, wall, {});
  physical.Restart(state);
  double rms = 1;
  for (int k = 0; k < 200; ++k) {
    CHECK(physical.ContinueCycle(1'000'000, state));
    rms = physical.mean_update_rms();
  }
  CHECK(rms < 1e-6);
  CHECK((state.nodes()[12] - Vector3d(12, 0, 0)).norm() < 1e-3);
}

// Stability bound for EI 6.35e-3 N mm^2 and lambda 1 mm: k_w lambda^3 N < 4 EI / lambda.
TEST_CASE("cycles leave the equilibrium on a soft wall where it is") {
  ChannelCase c(5e-4);
  INFO(c.contacts << " contacts");
  REQUIRE(c.contacts > 10);
  REQUIRE(5e-4 * c.contacts < 4 * 6.35e-3);
  CHECK(Drift(c, 20) < 1e-6);
}

TEST_CASE("cycles drift off the equilibrium on a stiff wall, and stay near it") {
  ChannelCase c(0.1);
  INFO(c.contacts << " contacts");
  REQUIRE(0.1 * c.contacts > 10 * 4 * 6.35e-3);
  const double drift = Drift(c, 20);
  CHECK(drift > 1e-4);
  CHECK(drift < 0.5);
}

}  // namespace torquer::test
