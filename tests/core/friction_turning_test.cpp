// Friction on the wall of instruments that are turned, and the force and torque at their hands.
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "host/simulator/core/internal_forces.h"
#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/sanitizer.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// Constant load per length on the whole wire.
class Weight final : public EnergyTerm {
 public:
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    double energy = 0;
    for (int q = 0; q < points.size(); ++q) {
      const auto p = static_cast<std::size_t>(q);
      out.TouchGradient(q);
      out.gradient[p][2] += kLoad * points.weight_mm[p];
      energy += kLoad * points.weight_mm[p] * points.position[p][2];
    }
    return energy;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  static constexpr double kLoad = 1e-3;  // N/mm
};

TEST_CASE("A wire that lies on the wall and is turned rolls; turned far up the wall, it slips") {
  constexpr double kRadius = 0.2;
  constexpr double kBore = 10;
  // One rigidity is stiff against twist; 0 means that the wire does not twist.
  const double torsional_rigidity = GENERATE(10.0, 0.0);
  const WireModel model =
      MakeWire({.segment_mm = 1,
                .rigidity_N_mm2 = 1e-3,
                .torsional_rigidity_N_mm2 = torsional_rigidity,
                .radius_mm = kRadius,
                .sheath = {Vector3d(0, 0, kRadius - kBore), Vector3d::UnitX()}});
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), kBore);
  const WallModel wall{.stiffness_N_mm2 = 10};
  const double mu = 0.3;
  effects::Friction friction(mu, 0.001, {model, wall});
  Weight weight;
  const std::vector<EnergyTerm*> terms{&friction, &weight};
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {}, terms);
  WireState state = LayStraight(model, 60);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, {60, 0}, state).converged);
  const auto turn_to = [&](double angle) {
    while (std::abs(state.rotation_rad() - angle) > 1e-9) {
      const double left = angle - state.rotation_rad();
      const double next =
          state.rotation_rad() + std::copysign(std::min(std::abs(left), 0.02), left);
      REQUIRE(Settle(*relaxation, {60, next}, state).converged);
    }
  };
  // Rolling: the center moves by angle times radius, limited by how far the load bends the wire.
  turn_to(1);
  CHECK(std::abs(state.nodes()[50][1]) == Approx(kRadius).epsilon(0.03));
  const double side = std::copysign(1, state.nodes()[50][1]);
  turn_to(-1);
  CHECK(state.nodes()[50][1] == Approx(-side * kRadius).epsilon(0.03));
  // The wire climbs until the slope of the wall reaches the angle of friction.
  turn_to(-20);
  const double slope = std::atan2(-side * state.nodes()[50][1], -state.nodes()[50][2]);
  CHECK(slope == Approx(std::atan(mu)).epsilon(0.02));
  // At this height the load turns the wire back by r sin f per length, whatever its material.
  InternalForces forces;
  FindInternalForces(model, state, relaxation->Current(), terms, forces);
  HandForces hands;
  hands.Find(relaxation->rods(), state, relaxation->Current(), forces, {});
  const double torque_mJ = kRadius * std::sin(std::atan(mu)) * 60 * 1e-3;
  CHECK(hands.hands()[0].torque_mJ == Approx(-torque_mJ).epsilon(0.03));
  CHECK(forces.twisting_mJ[30] == Approx(torque_mJ / 2).epsilon(0.03));
}

// Torques at the hands of instruments with flush tips, the innermost first. They lie on the wall
// and are turned together, far enough to climb until they slip.
std::vector<double> TorquesOfTurned(const std::vector<double>& radii_mm, double rigidity_N_mm2,
                                    double torsional_N_mm2, double mu) {
  constexpr double kBore = 10;
  std::vector<WireModel> instruments;
  for (const double radius_mm : radii_mm) {
    instruments.push_back(MakeWire({.segment_mm = 1,
                                    .rigidity_N_mm2 = rigidity_N_mm2,
                                    .torsional_rigidity_N_mm2 = torsional_N_mm2,
                                    .radius_mm = radius_mm,
                                    .sheath = {Vector3d(0, 0, 0.4 - kBore), Vector3d::UnitX()}}));
  }
  InstrumentStack stack(std::move(instruments));
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), kBore);
  const WallModel wall{.stiffness_N_mm2 = 10};
  InstrumentPoses poses(stack.size());
  for (int k = 0; k < stack.size(); ++k) poses[k].insertion_mm = 60;
  effects::Friction friction(mu, 0.001,
                             {.wire = stack.empty_rod(),
                              .wall = wall,
                              .instruments = std::vector<effects::Instrument>(radii_mm.size())});
  Weight weight;
  const std::vector<EnergyTerm*> terms{&friction, &weight};
  const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {}, terms);
  WireState state = WireState::Along(stack.empty_rod(), {Vector3d(100, 0, 0.4 - kBore)}, poses);
  relaxation->Restart(state);
  // Longer than the stack needs to climb.
  const int turns = Rounds(700, 4);
  for (int turn = 0; turn < turns; ++turn) {
    for (int k = 0; k < stack.size(); ++k) poses[k].rotation_rad -= 14.0 / turns;
    REQUIRE(Settle(*relaxation, poses, state, 50).converged);
  }
  InternalForces forces;
  FindInternalForces(relaxation->rods()[0], state, relaxation->Current(), terms, forces);
  HandForces hands;
  hands.Find(relaxation->rods(), state, relaxation->Current(), forces, {});
  std::vector<double> torques_mJ;
  for (int k = 0; k < stack.size(); ++k) {
    torques_mJ.push_back(hands.hands()[static_cast<std::size_t>(k)].torque_mJ);
  }
  return torques_mJ;
}

TEST_CASE("The hand of the instrument at the wall feels the torque on its surface") {
  constexpr double kMu = 0.3;
  const double torsional = test::kUnderSanitizer ? 10.0 : GENERATE(0.0, 10.0);
  const std::vector<double> nested = TorquesOfTurned({0.2, 0.4}, 5e-4, torsional, kMu);
  CHECK(nested[0] == Approx(0).margin(1e-9));
  // Both are one wire with the radius of the outer one.
  const std::vector<double> one = TorquesOfTurned({0.4}, 1e-3, 2 * torsional, kMu);
  CHECK(nested[1] == Approx(one[0]).epsilon(2e-3));
  if (torsional > 0) return;
  CHECK(nested[1] == Approx(-0.4 * std::sin(std::atan(kMu)) * 60 * 1e-3).epsilon(0.03));
}

// Time-dependent term like inertia: a dissipation that is unrelated to the wall.
class Drag final : public EnergyTerm {
 public:
  void Begin(const PointSet&) override {}
  bool Dissipates() const override { return true; }
  double Add(const PointSet& points, PointDerivatives& out) const override {
    for (int q = 0; q < points.size(); ++q) {
      out.TouchGradient(q);
      out.gradient[static_cast<std::size_t>(q)][1] += 1e-6;
    }
    return 0;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }
};

TEST_CASE("A loss that does not act on the surface adds no contact force and no torque") {
  const WireModel model = MakeWire({.segment_mm = 1, .rigidity_N_mm2 = 1, .radius_mm = 0.2});
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), 10);
  const WallModel wall{.stiffness_N_mm2 = 10};
  Drag drag;
  const std::vector<EnergyTerm*> terms{&drag};
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {}, terms);
  WireState state = LayStraight(model, 20);
  relaxation->Restart(state);
  Settle(*relaxation, {20, 0}, state);
  InternalForces forces;
  FindInternalForces(model, state, relaxation->Current(), terms, forces);
  for (const Vector3d& contact_N : forces.contact_N) CHECK(contact_N == Vector3d::Zero());
  CHECK(forces.twisting_mJ.front() == 0);
}

TEST_CASE("Turning a wire that is drawn takes from its axial friction, by the way it slides") {
  // The wire lies in a bore, and is withdrawn at v and turned at w. Its surface slides at the angle
  // b to its axis, with tan b = w r / v. The circumferential friction mu N sin b carries the wire
  // up the wall to the slope f. There it balances the load: tan f = mu sin b, N = load cos f. The
  // axial friction is mu N cos b.
  constexpr double kRadius = 0.2;
  constexpr double kBore = 10;
  constexpr double kMu = 0.3;
  constexpr double kLoad = 1e-3;
  const double slides_rad = GENERATE(0.0, 0.5, 1.2);
  const double torsional_rigidity = GENERATE(0.0, 10.0);
  if (kUnderSanitizer && (slides_rad == 0.5) != (torsional_rigidity == 0)) return;
  const WireModel model =
      MakeWire({.segment_mm = 1,
                .rigidity_N_mm2 = 1e-3,
                .torsional_rigidity_N_mm2 = torsional_rigidity,
                .radius_mm = kRadius,
                .sheath = {Vector3d(0, 0, kRadius - kBore), Vector3d::UnitX()}});
  const Cylinder field(Side::kInside, Vector3d::Zero(), Vector3d::UnitX(), kBore);
  const WallModel wall{.stiffness_N_mm2 = 10};
  effects::Friction friction(kMu, 0.001, {model, wall});
  Weight weight;
  const std::vector<EnergyTerm*> terms{&friction, &weight};
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {}, terms);
  // Longer than the wire needs to climb, in steps of 0.02 mm.
  const int steps = 700;
  const double drawn_mm = 0.02 * std::cos(slides_rad);
  const double turned_rad = 0.02 * std::sin(slides_rad) / kRadius;
  WireState state = LayStraight(model, 60 + steps * drawn_mm);
  relaxation->Restart(state);
  for (int k = 1; k <= steps; ++k) {
    const InstrumentPoses target(60 + (steps - k) * drawn_mm, k * turned_rad);
    REQUIRE(Settle(*relaxation, target, state).converged);
  }
  const PointSet& points = relaxation->Current().points;
  PointDerivatives out;
  out.used.assign(points.position.size(), 0);
  out.gradient.resize(points.position.size());
  friction.Add(points, out);
  double along_N = 0;
  double borne_mm = 0;
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    if (points.position[p][0] < 30 || points.position[p][0] > 50) continue;
    along_N -= out.gradient[p][0];
    borne_mm += points.weight_mm[p];
  }
  const Vector3d& middle = state.nodes()[40];
  const double slope = std::atan(kMu * std::sin(slides_rad));
  INFO("slides at " << slides_rad << " rad, friction " << along_N / (kLoad * borne_mm));
  CHECK(std::atan2(std::abs(middle[1]), -middle[2]) == Approx(slope).epsilon(0.02).margin(1e-6));
  CHECK(along_N / (kLoad * borne_mm) ==
        Approx(kMu * std::cos(slope) * std::cos(slides_rad)).epsilon(0.02));
}

}  // namespace
}  // namespace torquer::test
