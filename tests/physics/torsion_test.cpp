// Twist compared with closed forms: T L / GJ, and the twists at which rod and ring buckle.
#include <catch2/catch.hpp>
#include <numbers>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Springs at the distal end. They act on its place along some axes, on the last segment's
// direction, and on that segment's normal.
class HeldEnd final : public EnergyTerm {
 public:
  HeldEnd(const Vector3d& place, const Vector3d& along, const Vector3d& direction,
          const Vector3d& normal)
      : place_(place), along_(along), direction_(direction), normal_(normal) {}

  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    const int q = points.size() - 1;
    const auto p = static_cast<std::size_t>(q);
    const Vector3d away = points.position[p] - place_;
    out.Touch(q);
    out.gradient[p] += kHold * along_.cwiseProduct(away);
    if (out.with_hessian) out.hessian[p].diagonal() += kHold * along_;

    const Vector3d tangent = points.Tangent(q);
    const Vector3d& normal = points.Normal(q);
    // The normal follows the tangent: d normal = -(normal . d tangent) tangent.
    out.on_tangents.push_back({q / points.per_segment,
                               kTurn * (tangent.dot(normal_) * normal - direction_),
                               kTurn * normal * normal.transpose()});
    const double spin = -normal_.dot(tangent.cross(normal));
    out.on_spins.push_back({q, kTurn * spin, kTurn * normal.dot(normal_), Vector3d::Zero()});
    return (kHold * away.dot(along_.cwiseProduct(away)) +
            kTurn * ((tangent - direction_).squaredNorm() + (normal - normal_).squaredNorm())) /
           2;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  static constexpr double kHold = 1e3;  // N/mm
  static constexpr double kTurn = 1e4;  // mJ
  Vector3d place_;
  Vector3d along_;
  Vector3d direction_;
  Vector3d normal_;
};

TEST_CASE("A torque T twists a straight wire by T L / GJ") {
  // The tip, bent by a quarter turn, is the lever arm of a force perpendicular to shaft and tip.
  constexpr double kShaft = 40;
  constexpr double kArc = 10;
  constexpr double kGj = 0.02;
  const double radius = kArc / (std::numbers::pi / 2);
  const WireModel model(0.5,
                        {{0, 100, 0.2, 1 / radius, 0, kGj * 1e3},
                         {kArc, 100, 0.2, 1 / radius, 0, kGj * 1e3},
                         {kArc + 1e-6, 100, 0.2, 0, 0, kGj}},
                        kArc, 60, BendingLaw::kExact, Sheath{});
  const FreeSpace field;
  const WallModel wall;
  const Vector3d across = Vector3d::UnitX().cross(model.sheath_normal());
  const double force_N = GENERATE(1e-5, 1e-4, -2e-4);
  EndForce force(force_N * across);
  const std::vector<EnergyTerm*> terms{&force};
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-9}, terms);
  WireState state = LayStraight(model, kShaft + kArc);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, {kShaft + kArc, 0}, state, 200).converged);
  double twist = 0;
  for (const double t : state.twist_rad()) twist += t;
  // The arm turns away from the force: T = F a cos(twist), where a is the polygon's arm. Half of
  // the joint between shaft and arm belongs to the arm. The shaft bends a little.
  const double arm = state.nodes().back().tail<2>().norm();
  CHECK(arm == Approx(radius).epsilon(0.05));
  CHECK(twist == Approx(force_N * arm * std::cos(twist) * (kShaft - 0.25) / kGj).epsilon(1e-2));
  CHECK(std::abs(twist) > 0.01);
}

// A wire laid along a path and held at its end.
struct Held {
  WireModel model;
  FreeSpace field;
  WallModel wall;
  HeldEnd held;
  std::vector<EnergyTerm*> terms{&held};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Held(double segment_mm, double ratio, double length_mm, const std::vector<Vector3d>& path,
       const Vector3d& along)
      : model(MakeWire({.segment_mm = segment_mm,
                        .rigidity_N_mm2 = 1,
                        .torsional_rigidity_N_mm2 = ratio,
                        .max_length_mm = length_mm + 1})),
        held(LaidEnd(path, length_mm, along)),
        relaxation(MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-8}, terms)),
        state(model) {
    state = WireState::Along(model, path, {length_mm, 0});
    relaxation->Restart(state);
  }

  HeldEnd LaidEnd(const std::vector<Vector3d>& path, double length_mm, const Vector3d& along) {
    WireState laid = WireState::Along(model, path, {length_mm, 0});
    return HeldEnd(laid.nodes().back(), along, laid.tangents().back(), laid.normals().back());
  }

  void TurnTo(double angle) {
    REQUIRE(Settle(*relaxation, {state.insertion_mm(), angle}, state, 200).converged);
  }
};

TEST_CASE("A rod clamped at both ends buckles at the torque 8.987 EI/L (Greenhill)") {
  constexpr double kLength = 40;
  constexpr double kRatio = 0.8;  // GJ / EI
  const double critical = 8.9868 / kRatio;
  // Almost free along its axis, because buckling shortens it.
  Held rod(1, kRatio, kLength, {}, Vector3d(1e-6, 1, 1));
  const auto bulge = [&rod] {
    double largest = 0;
    for (const Vector3d& x : rod.state.nodes()) largest = std::max(largest, std::hypot(x[1], x[2]));
    return largest;
  };
  rod.TurnTo(0.99 * critical);
  CHECK(bulge() < 1e-3);
  for (const double twist : rod.state.twist_rad())
    CHECK(twist < -0.1);  // the distal end stays behind
  rod.TurnTo(1.02 * critical);
  CHECK(bulge() > 1);
  rod.TurnTo(0.95 * critical);
  CHECK(bulge() < 1e-2);
}

TEST_CASE(
    "A straight wire turned against its held end bears the torque GJ angle / L, as the hand") {
  constexpr double kLength = 40;
  constexpr double kGj = 0.8;
  constexpr double kAngle = 2;
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  Held rod(segment_mm, kGj, kLength, {}, Vector3d(1, 1, 1));
  rod.TurnTo(kAngle);
  InternalForces forces;
  FindInternalForces(rod.model, rod.state, rod.relaxation->Current(), rod.terms, forces);
  HandForces hands;
  hands.Find(rod.relaxation->rods(), rod.state, rod.relaxation->Current(), forces, {});
  // The spring holds the last segment as a whole: the twisted length ends in its middle.
  const double torque = kGj * kAngle / (kLength - segment_mm / 2);
  for (const double twisting : forces.twisting_mJ) CHECK(twisting == Approx(-torque).epsilon(1e-3));
  CHECK(hands.hands()[0].torque_mJ == Approx(torque).epsilon(1e-3));
  // The wire is pulled in, because a longer wire would be twisted less.
  CHECK(hands.hands()[0].axial_N == Approx(-torque * torque / (2 * kGj)).epsilon(2e-3));
}

TEST_CASE("A ring leaves its plane at the twist 2 pi sqrt(3) EI/GJ (Michell)") {
  constexpr double kLength = 60;
  constexpr double kRatio = 1.2;
  const double critical = 2 * std::numbers::pi * std::sqrt(3.0) / kRatio;
  const double radius = kLength / (2 * std::numbers::pi);
  std::vector<Vector3d> circle;
  for (int k = 1; k <= 740; ++k) {
    const double a = k * std::numbers::pi / 360;
    circle.emplace_back(radius * std::sin(a), radius * (1 - std::cos(a)), 0);
  }
  Held ring(1, kRatio, kLength, circle, Vector3d(1, 1, 1));
  // The ring turns over into a figure eight, which has no twist.
  const auto twist = [&ring] {
    double sum = 0;
    for (const double t : ring.state.twist_rad()) sum += t;
    return sum;
  };
  for (const double part : {0.2, 0.4, 0.6, 0.8, 0.9, 0.97}) ring.TurnTo(part * critical);
  CHECK(twist() == Approx(-0.97 * critical).epsilon(0.02));
  ring.TurnTo(1.01 * critical);
  CHECK(std::abs(twist()) < 0.5 * critical);
}

// Node positions of a wire with a bent tip, turned in a bend of 30 mm.
std::vector<Vector3d> TurnedInBend(double segment_mm, double ratio) {
  const WireModel model = MakeWire({.segment_mm = segment_mm,
                                    .rigidity_N_mm2 = 1,
                                    .torsional_rigidity_N_mm2 = ratio,
                                    .tip_mm = 12,
                                    .tip_curvature_1_per_mm = 0.05,
                                    .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
  const Torus field(Side::kInside, 30, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.5};
  const std::vector<EnergyTerm*> none;
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-10}, none);
  WireState state(model);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, {40, 0}, state).converged);
  REQUIRE(Settle(*relaxation, {40, 1.3}, state).converged);
  return state.nodes();
}

double LargestApart(const std::vector<Vector3d>& a, const std::vector<Vector3d>& b) {
  REQUIRE(a.size() == b.size());
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, (a[i] - b[i]).norm());
  return largest;
}

TEST_CASE("A wire that does not twist is the limit of one that is ever stiffer against twist") {
  // The twist is proportional to torque over GJ, and so is the distance from the limit.
  const double segment_mm = GENERATE(2.0, 1.0);
  const std::vector<Vector3d> limit = TurnedInBend(segment_mm, 0);
  const double soft = LargestApart(TurnedInBend(segment_mm, 1e2), limit);
  const double stiff = LargestApart(TurnedInBend(segment_mm, 1e3), limit);
  const double stiffest = LargestApart(TurnedInBend(segment_mm, 1e4), limit);
  CHECK(soft > 1e-4);
  CHECK(stiff == Approx(soft / 10).epsilon(0.05));
  CHECK(stiffest == Approx(stiff / 10).epsilon(0.05));
}

}  // namespace
}  // namespace torquer::test
