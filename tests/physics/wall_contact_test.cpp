// Contact compared with closed forms: a wire drawn round a post, and its tip on the wall of a
// torus.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

TEST_CASE("A wire drawn round a post presses on it with (F - EI/2R^2)/R and lifts off in time") {
  // The wire is clamped where it meets the post. A force F pulls its end at the angle `pull` to the
  // clamp. In an elastica under normal loads T + EI kappa^2/2 is constant; at the end it is F. In
  // contact, kappa = 1/R, T = F - EI/2R^2, and the line load is T/R. Beyond the contact, theta is
  // the angle to the force. There EI theta'' = F sin theta, so that kappa = 2 sqrt(F/EI)
  // sin(theta/2). The wire leaves the post where that is 1/R.
  const double rigidity = 1;
  const double wire_radius = 0.2;
  const double radius = 10;
  const double force_N = 0.05;
  const double pull = 2.0;
  const double lambda = 0.25;
  const WireModel model = MakeWire({.segment_mm = lambda,
                                    .rigidity_N_mm2 = rigidity,
                                    .radius_mm = wire_radius,
                                    .sheath = {Vector3d(0, -radius, 0), Vector3d::UnitX()}});
  const Cylinder post(Side::kOutside, Vector3d::Zero(), Vector3d::UnitZ(), radius - wire_radius);
  const WallModel wall{.stiffness_N_mm2 = 100, .points_per_segment = 1};
  EndForce force(force_N * Vector3d(std::cos(pull), std::sin(pull), 0));
  const std::vector<EnergyTerm*> terms{&force};
  NewtonRelaxation relaxation(model, post, wall, {.tolerance = 1e-9}, terms);
  WireState state(model);
  std::vector<Vector3d> path;
  for (double a = 0.02; a < pull; a += 0.02) {
    path.emplace_back(radius * std::sin(a), -radius * std::cos(a), 0);
  }
  state = WireState::Along(model, path, {60, 0});
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {60, 0}, state).converged);

  const double tension = force_N - rigidity / (2 * radius * radius);
  const double leaves = pull - 2 * std::asin(std::sqrt(rigidity / force_N) / (2 * radius));
  const QuadraticModel& at = relaxation.Current();
  double last_contact = 0;
  double load = 0;
  double length = 0;
  for (int q = 0; q < at.points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    if (!at.points.touches[p]) continue;
    const Vector3d& x = at.points.position[p];
    const double angle = std::atan2(x[0], -x[1]);
    last_contact = std::max(last_contact, angle);
    // Inner part only: at both ends a concentrated force passes into the wall.
    if (angle < 0.4 || angle > leaves - 0.4) continue;
    load += wall.stiffness_N_mm2 * at.points.weight_mm[p] *
            (at.points.radius_mm[p] - at.points.clearance[p].clearance_mm);
    length += at.points.weight_mm[p];
  }
  REQUIRE(length > 3);
  CHECK(load / length == Approx(tension / radius).epsilon(0.01));
  CHECK(last_contact == Approx(leaves).margin(2 * lambda / radius));
  // The end points in the force's direction.
  CHECK(state.tangents().back().dot(Vector3d(std::cos(pull), std::sin(pull), 0)) > 1 - 1e-4);
  // Tension from the loads beyond: constant along the post.
  const int i = static_cast<int>(0.5 * leaves * radius / lambda);
  CHECK(-at.distal_gradient[static_cast<std::size_t>(i)].dot(
            state.tangents()[static_cast<std::size_t>(i)]) == Approx(tension).epsilon(0.01));
}

TEST_CASE("Normal loads leave T + EI kappa^2/2 the same all along a wire in a torus") {
  // From the tip's tilted contact to the sheath, across every contact in between.
  const double rigidity = 6.35e-3;
  const double ring = 40;
  const double lambda = 0.5;
  const WireModel model = MakeWire({.segment_mm = lambda,
                                    .rigidity_N_mm2 = rigidity,
                                    .max_length_mm = 150,
                                    .sheath = {Vector3d(ring, 0, 0), Vector3d::UnitY()}});
  const Torus field(Side::kInside, ring, 3);
  const WallModel wall{.stiffness_N_mm2 = 1, .points_per_segment = 2};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, none);
  WireState state(model);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {130, 0}, state).converged);
  const QuadraticModel& at = relaxation.Current();

  const auto tip = static_cast<std::size_t>(at.points.size() - 1);
  REQUIRE(at.points.touches[tip]);
  int contacts = 0;
  for (const std::uint8_t touches : at.points.touches) contacts += touches;
  REQUIRE(contacts >= 2);

  const auto n = static_cast<std::size_t>(state.segments());
  // The costate is minus the total force on everything beyond a node.
  const double end_tension = -at.distal_gradient[n - 1].dot(state.tangents()[n - 1]);
  CHECK(end_tension < 0);
  const double largest_bending = rigidity / (2 * ring * ring);
  for (std::size_t i = 10; i + 1 < n; ++i) {
    const double kappa = (state.tangents()[i] - state.tangents()[i - 1]).norm() / lambda;
    const Vector3d along = (state.tangents()[i] + state.tangents()[i - 1]) / 2;
    const double sum = -at.distal_gradient[i].dot(along) + rigidity * kappa * kappa / 2;
    INFO("node " << i);
    CHECK(sum == Approx(end_tension).margin(0.01 * largest_bending));
  }
  CHECK(std::abs(state.nodes().back()[2]) < 1e-6);
}

// Constant downward load per length of the wire.
class EvenLoad final : public EnergyTerm {
 public:
  explicit EvenLoad(double load_N_mm) : load_N_mm_(load_N_mm) {}
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    double energy = 0;
    for (int q = 0; q < points.size(); ++q) {
      const auto p = static_cast<std::size_t>(q);
      out.TouchGradient(q);
      out.gradient[p][2] += load_N_mm_ * points.weight_mm[p];
      energy += load_N_mm_ * points.weight_mm[p] * points.position[p][2];
    }
    return energy;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  double load_N_mm_;
};

TEST_CASE(
    "A loaded end on a soft floor sinks as a beam on an elastic foundation, to second order") {
  // Hetenyi: a long beam with a force P at its free end sinks there by 2 P b / k. Here b = (k /
  // 4EI)^(1/4). A uniform load keeps the whole wire on the floor.
  constexpr double kDeep_mm = 0.01;
  constexpr double kRigidity = 1;
  constexpr double kDecay = 0.1;  // b, 1/mm
  const double stiffness = 4 * kRigidity * std::pow(kDecay, 4);
  const int points = GENERATE(1, 2, 8);
  const WallModel wall{.stiffness_N_mm2 = stiffness, .points_per_segment = points};
  const HalfSpace floor(Vector3d(0, 0, kDeep_mm - 0.2), Vector3d::UnitZ());
  EvenLoad load(stiffness * kDeep_mm);
  EndForce force(Vector3d(0, 0, -kDeep_mm * stiffness / (2 * kDecay)));
  const std::vector<EnergyTerm*> terms{&load, &force};
  double before = 0;
  for (const double segment_mm : {2.0, 1.0, 0.5, 0.25}) {
    const WireModel model =
        MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = kRigidity, .radius_mm = 0.2});
    NewtonRelaxation relaxation(model, floor, wall, {.tolerance = 1e-11}, terms);
    WireState state = LayStraight(model, 100);
    relaxation.Restart(state);
    REQUIRE(Settle(relaxation, {100, 0}, state).converged);
    const double error = -state.tip()[2] / kDeep_mm - 1;
    INFO(points << " points, segments of " << segment_mm << " mm: " << error);
    const double size = std::pow(kDecay * segment_mm, 2);
    CHECK(std::abs(error) < size);
    if (before != 0) CHECK(std::abs(error) < std::abs(before) / 3.5);
    before = error;
  }
}

}  // namespace
}  // namespace torquer::test
