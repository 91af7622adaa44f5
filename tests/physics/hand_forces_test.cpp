// Forces and torques at the hand, compared with the work that they do and with closed forms.
#include "host/simulator/core/stack/hand_forces.h"

#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kRing = 30;

// Instruments pushed round a bend, without friction.
struct Round {
  InstrumentStack stack;
  Torus field{Side::kInside, kRing, 3};
  WallModel wall{.stiffness_N_mm2 = 0.5};
  std::vector<EnergyTerm*> terms;
  std::unique_ptr<Relaxation> relaxation;
  WireState state;
  InternalForces forces;
  HandForces hands;

  Round(std::vector<WireModel> instruments, const InstrumentPoses& poses,
        const Clearance& clearance = {})
      : stack(std::move(instruments), clearance),
        relaxation(MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, terms)),
        state(stack.empty_rod(), stack.size()) {
    std::vector<Vector3d> path;
    for (double a = 0.01; a < 5; a += 0.01) {
      path.emplace_back(kRing * std::cos(a), kRing * std::sin(a), 0);
    }
    state = WireState::Along(stack.empty_rod(), path, poses);
    relaxation->Restart(state);
    GoTo(poses);
  }
  void GoTo(const InstrumentPoses& poses) {
    REQUIRE(Settle(*relaxation, poses, state, 200).converged);
  }
  double energy() const { return relaxation->Current().energy_mJ; }
  const HandForce& Hand(int k, const Sliding& sliding = {}) {
    FindInternalForces(relaxation->rods()[0], state, relaxation->Current(), terms, forces);
    hands.Find(relaxation->rods(), state, relaxation->Current(), forces, sliding);
    return hands.hands()[static_cast<std::size_t>(k)];
  }
};

// A ratio of 0 means that it does not twist.
WireModel Instrument(double segment_mm, double rigidity, double radius_mm, double tip_mm = 0,
                     double curvature = 0, double torsional_ratio = 0) {
  return MakeWire({.segment_mm = segment_mm,
                   .rigidity_N_mm2 = rigidity,
                   .torsional_rigidity_N_mm2 = torsional_ratio * rigidity,
                   .radius_mm = radius_mm,
                   .tip_mm = tip_mm,
                   .tip_curvature_1_per_mm = curvature,
                   .max_length_mm = 140,
                   .sheath = {Vector3d(kRing, 0, 0), Vector3d::UnitY()}});
}

// The innermost `count` of three instruments.
std::vector<WireModel> Bent(int count, double segment_mm, double torsional_ratio = 0) {
  std::vector<WireModel> three;
  three.push_back(Instrument(segment_mm, 1, 0.2, 12, 0.05, torsional_ratio));
  three.push_back(Instrument(segment_mm, 2, 0.4, 6, 0.03, torsional_ratio));
  three.push_back(Instrument(segment_mm, 3, 0.6, 0, 0, torsional_ratio));
  three.erase(three.begin() + count, three.end());
  return three;
}

InstrumentPoses Inside(int count, double turned_rad) {
  const double inside_mm[] = {95.3, 71.2, 40.4};
  InstrumentPoses poses(count);
  for (int k = 0; k < count; ++k) poses[k] = {inside_mm[k], turned_rad + 0.3 * k};
  return poses;
}

TEST_CASE("The hand's force is the energy that a push takes, of each instrument") {
  const int count = GENERATE(1, 2, 3);
  const double torsional_ratio = GENERATE(0.0, 0.1);
  const double segment_mm = 0.5;
  const InstrumentPoses poses = Inside(count, 0);
  Round round(Bent(count, segment_mm, torsional_ratio), poses);
  for (int k = 0; k < count; ++k) {
    const HandForce hand = round.Hand(k);
    InstrumentPoses there = poses;
    there[k].insertion_mm += segment_mm;
    round.GoTo(there);
    const double more = round.energy();
    there[k].insertion_mm -= 2 * segment_mm;
    round.GoTo(there);
    const double work = (more - round.energy()) / (2 * segment_mm);
    round.GoTo(poses);
    INFO("instrument " << k << " of " << count << ", GJ/EI " << torsional_ratio);
    CHECK(hand.axial_N == Approx(work).margin(1e-5));
  }
}

// The innermost instrument has clearance in the lumens of the others.
constexpr Clearance kRoom{
    .has_room = {false, true}, .lumen_radius_mm = {0, 0.35, 0.35}, .stiffness_N_mm2 = 0.5};

TEST_CASE("With room, too, the hand's force is the energy that a push takes") {
  const int count = GENERATE(2, 3);
  const double torsional_ratio = GENERATE(0.0, 0.1);
  const bool outer_leads = GENERATE(false, true);
  const double segment_mm = 0.25;  // forces have a ripple with the period of a segment
  InstrumentPoses poses = Inside(count, 0);
  if (outer_leads) std::swap(poses[0].insertion_mm, poses[1].insertion_mm);
  Round round(Bent(count, segment_mm, torsional_ratio), poses, kRoom);
  REQUIRE(round.relaxation->Current().between[0].pressed_N > 1e-3);
  double sum_N = 0;
  for (int k = 0; k < count; ++k) {
    const HandForce hand = round.Hand(k);
    InstrumentPoses there = poses;
    there[k].insertion_mm += segment_mm;
    round.GoTo(there);
    const double more = round.energy();
    there[k].insertion_mm -= 2 * segment_mm;
    round.GoTo(there);
    const double work = (more - round.energy()) / (2 * segment_mm);
    round.GoTo(poses);
    INFO("instrument " << k << " of " << count << ", GJ/EI " << torsional_ratio
                       << (outer_leads ? ", the outer one leads" : ""));
    CHECK(hand.axial_N == Approx(work).margin(1e-4));
    sum_N += std::abs(work);
  }
  CHECK(sum_N > 1e-3);
}

TEST_CASE("The hand's torque is the energy that a turn takes on the curve as it lies") {
  const int count = GENERATE(1, 3);
  const InstrumentPoses poses = Inside(count, 0.4);
  Round round(Bent(count, 0.5), poses);
  for (int k = 0; k < count; ++k) {
    const double torque = round.Hand(k).torque_mJ;
    const auto turned = [&](double by_rad) {
      WireState there = round.state;
      InstrumentPoses at = poses;
      at[k].rotation_rad += by_rad;
      there.SetPoses(at);
      if (count == 1) there.Rotate(at[0].rotation_rad);
      round.relaxation->Restart(there);
      return round.energy();
    };
    const double work = (turned(0.01) - turned(-0.01)) / 0.02;
    round.relaxation->Restart(round.state);
    INFO("instrument " << k << " of " << count);
    CHECK(torque == Approx(work).epsilon(1e-3).margin(1e-9));
    if (k < 2) CHECK(std::abs(work) > 1e-4);
  }
}

TEST_CASE("A turn of a shaped instrument in a shaped one takes the energy of both") {
  // Rest curvatures overlap, so the sum of the bending energies changes by more than the rod's.
  const double segment_mm = 0.5;
  std::vector<WireModel> instruments;
  instruments.push_back(Instrument(segment_mm, 1, 0.2, 45.3, 0.03));
  instruments.push_back(Instrument(segment_mm, 2, 0.4, 13.4, -0.02));
  const InstrumentPoses poses{{95.3, 0.4}, {71.2, 1.2}};
  Round round(std::move(instruments), poses);
  for (int k = 0; k < 2; ++k) {
    const double torque = round.Hand(k).torque_mJ;
    const auto turned = [&](double by_rad) {
      WireState there = round.state;
      InstrumentPoses at = poses;
      at[k].rotation_rad += by_rad;
      there.SetPoses(at);
      round.relaxation->Restart(there);
      return round.relaxation->EnergyMJ(there);
    };
    const double work = (turned(0.01) - turned(-0.01)) / 0.02;
    round.relaxation->Restart(round.state);
    INFO("instrument " << k);
    CHECK(torque == Approx(work).epsilon(1e-3).margin(1e-9));
    CHECK(std::abs(work) > 1e-4);
  }
}

TEST_CASE("Two arcs in each other keep the energy of the curve between them") {
  // In free space they lie on an arc of the curvature sum(EI kappa) / sum(EI). Each is bent from
  // its own curvature to it, which takes EI |difference|^2 / 2 per length.
  const double turned_rad = GENERATE(0.0, 1.1, 3.14159265358979);
  const double length_mm = 60;
  const double rigidity[] = {1, 2};
  const double curvature[] = {0.02, 0.01};
  double energy_mJ[2];
  const double segments_mm[] = {0.5, 0.25};
  for (int refined = 0; refined < 2; ++refined) {
    std::vector<WireModel> instruments;
    for (int k = 0; k < 2; ++k) {
      instruments.push_back(MakeWire({.segment_mm = segments_mm[refined],
                                      .rigidity_N_mm2 = rigidity[k],
                                      .radius_mm = 0.2 * (k + 1),
                                      .tip_mm = 100,
                                      .tip_curvature_1_per_mm = curvature[k],
                                      .max_length_mm = 100}));
    }
    InstrumentStack stack(std::move(instruments));
    const FreeSpace field;
    const WallModel wall;
    const std::vector<EnergyTerm*> none;
    const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {.tolerance = 1e-9}, none);
    const InstrumentPoses poses{{length_mm, turned_rad}, {length_mm, 0}};
    WireState state = WireState::Along(stack.empty_rod(),
                                       {Vector3d::Zero(), Vector3d(2 * length_mm, 0, 0)}, poses);
    relaxation->Restart(state);
    const TickReport report = Settle(*relaxation, poses, state, 200);
    REQUIRE(report.converged);
    energy_mJ[refined] = report.energy_mJ;
  }
  const Eigen::Vector2d of_a =
      curvature[0] * Eigen::Vector2d(std::cos(turned_rad), std::sin(turned_rad));
  const Eigen::Vector2d of_b(curvature[1], 0);
  const Eigen::Vector2d common = (rigidity[0] * of_a + rigidity[1] * of_b) / 3;
  const double expected_mJ =
      length_mm / 2 *
      (rigidity[0] * (common - of_a).squaredNorm() + rigidity[1] * (common - of_b).squaredNorm());
  INFO("turned by " << turned_rad);
  // The hats at the ends are of first order in the segment.
  CHECK(2 * energy_mJ[1] - energy_mJ[0] == Approx(expected_mJ).epsilon(1e-3));
}

TEST_CASE("The hand's torque on a twisting wire is the energy of a turn") {
  const int count = GENERATE(1, 2, 3);
  const bool room = GENERATE(false, true);
  if (count == 1 && room) return;
  const InstrumentPoses poses = Inside(count, 0.4);
  // The work of the bulges is left out, an error of second order.
  const double segment_mm = room ? 0.25 : 0.5;
  Round round(Bent(count, segment_mm, 0.1), poses, room ? kRoom : Clearance());
  for (int k = 0; k < count; ++k) {
    const double torque = round.Hand(k).torque_mJ;
    const auto turned = [&](double by_rad) {
      InstrumentPoses there = poses;
      there[k].rotation_rad += by_rad;
      round.GoTo(there);
      return round.energy();
    };
    const double work = (turned(0.01) - turned(-0.01)) / 0.02;
    round.GoTo(poses);
    INFO("instrument " << k << " of " << count);
    CHECK(torque == Approx(work).epsilon(1e-3).margin(1e-7));
    if (k < 2) CHECK(std::abs(work) > 1e-4);
  }
}

// Shaped instruments that cover each other's shape: a straight catheter on a shaped wire, or one
// with another shape. Tips and sections lie between joints.
TEST_CASE("Instruments that bend each other push and turn with the energy that this takes") {
  const double catheter_1_per_mm = GENERATE(0.0, -0.02);
  const bool shaped_at_clamp = GENERATE(false, true);
  const double segment_mm = 0.5;
  std::vector<WireModel> instruments;
  instruments.push_back(Instrument(segment_mm, 1, 0.2, shaped_at_clamp ? 138.2 : 45.3, 0.03, 0.3));
  instruments.push_back(
      Instrument(segment_mm, 2, 0.4, shaped_at_clamp ? 138.2 : 13.4, catheter_1_per_mm, 0.3));
  const InstrumentPoses poses{{95.3, 0.4}, {71.2, 1.2}};
  Round round(std::move(instruments), poses);
  const auto work = [&](auto change, double by) {
    double energy_mJ[2];
    for (const int way : {1, -1}) {
      InstrumentPoses there = poses;
      change(there, way * by);
      round.GoTo(there);
      energy_mJ[way == 1] = round.energy();
    }
    round.GoTo(poses);
    return (energy_mJ[1] - energy_mJ[0]) / (2 * by);
  };
  for (int k = 0; k < 2; ++k) {
    const HandForce hand = round.Hand(k);
    const double push_N =
        work([k](InstrumentPoses& there, double mm) { there[k].insertion_mm += mm; }, segment_mm);
    const double turn_mJ =
        work([k](InstrumentPoses& there, double rad) { there[k].rotation_rad += rad; }, 0.01);
    INFO("instrument " << k << ", catheter " << catheter_1_per_mm
                       << (shaped_at_clamp ? ", shaped at the clamp" : ""));
    // The sheath holds a shaped instrument straight. A push releases that energy.
    const double curvature = k == 0 ? 0.03 : catheter_1_per_mm;
    const double released_N = shaped_at_clamp ? (k + 1) * curvature * curvature / 2 : 0;
    CHECK(hand.axial_N == Approx(push_N - released_N).epsilon(0.01).margin(1e-5));
    CHECK(hand.torque_mJ == Approx(turn_mJ).epsilon(1e-3).margin(1e-7));
  }
}

TEST_CASE(
    "Friction between instruments is the same on any mesh, with any steps in their properties") {
  // Rest shapes and rigidities have steps in a bend, where the exchanged moments are couples.
  const auto friction_N = [](double segment_mm) {
    Round round(Bent(3, segment_mm), {{95.3, 0.4}, {71.2, 0.7}, {40.4, 0}});
    Sliding sliding{.coefficient = 0.3};
    sliding.direction[0] = {0, 1, 1, 0};
    const double with_N = round.Hand(0, sliding).axial_N;
    return with_N - round.Hand(0).axial_N;
  };
  const double fine_N = friction_N(0.25);
  CHECK(fine_N > 1e-5);
  for (const double segment_mm : {2.0, 1.0, 0.5}) {
    INFO("segments of " << segment_mm << " mm");
    CHECK(friction_N(segment_mm) == Approx(fine_N).epsilon(0.12 * segment_mm + 0.01));
  }
}

TEST_CASE("Pushed round a bend without friction, the hand pushes as the tip does") {
  // T + M^2/2EI is constant along the wire; within the straight sheath it equals the tension.
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  Round round({Instrument(segment_mm, 1, 0.2)}, {95.3, 0.0});
  const double hand_N = round.Hand(0).axial_N;
  const double tip_N = -round.forces.tension_N.back();
  INFO("segment " << segment_mm << " mm: hand " << hand_N << " N, tip " << tip_N << " N");
  CHECK(tip_N > 1e-4);
  CHECK(hand_N == Approx(tip_N).margin(1e-4 * segment_mm));
  CHECK(-round.forces.tension_N.front() > hand_N + 1e-5);  // because of the bend at the sheath
}

TEST_CASE("A straight wire hands on what stops it") {
  const double segment_mm = GENERATE(2.0, 0.25);
  const WireModel model = MakeWire(
      {.segment_mm = segment_mm, .rigidity_N_mm2 = 50, .radius_mm = 0.2, .max_length_mm = 100});
  const HalfSpace stop(Vector3d(60, 0, 0), -Vector3d::UnitX());
  const WallModel wall{.stiffness_N_mm2 = 1, .points_per_segment = 2};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation relaxation(model, stop, wall, {.tolerance = 1e-9}, none);
  WireState state = LayStraight(model, 59.82);
  relaxation.Restart(state);
  REQUIRE(Settle(relaxation, {59.82, 0}, state).converged);
  InternalForces forces;
  FindInternalForces(model, state, relaxation.Current(), none, forces);
  HandForces hands;
  hands.Find(relaxation.rods(), state, relaxation.Current(), forces, {});
  // The end is 0.02 mm deep in a wall, which presses on half a piece (a quarter of a segment).
  const double force_N = 0.02 * segment_mm / 4;
  CHECK(hands.hands()[0].axial_N == Approx(force_N));
  CHECK(hands.hands()[0].torque_mJ == Approx(0).margin(1e-12));
  CHECK(forces.tension_N.back() == Approx(-force_N));
  CHECK(forces.contact_N.back().x() == Approx(-force_N));
}

TEST_CASE("A wire drawn through a round catheter is held back by the capstan law") {
  constexpr double kForce = 0.005;
  constexpr double kStiff = 1e4;
  const double mu = GENERATE(0.0, 0.1, 0.3);
  const double segment_mm = GENERATE(2.0, 1.0, 0.5, 0.25);
  const int way = GENERATE(-1, 1);
  std::vector<WireModel> instruments;
  instruments.push_back(MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = 1e-5}));
  // Stiff catheter: it keeps its round rest shape whatever the wire does.
  instruments.push_back(MakeWire({.segment_mm = segment_mm,
                                  .rigidity_N_mm2 = kStiff,
                                  .radius_mm = 0.5,
                                  .tip_mm = 90,
                                  .tip_curvature_1_per_mm = 1 / kRing}));
  const InstrumentPoses poses{{70, 0}, {60, 0}};
  const double angle = 60 / kRing;
  InstrumentStack stack(std::move(instruments));
  const Vector3d& normal = stack.empty_rod().sheath_normal();
  EndForce force(kForce * (std::cos(angle) * Vector3d::UnitX() + std::sin(angle) * normal));
  const FreeSpace field;
  const WallModel wall;
  const std::vector<EnergyTerm*> terms{&force};
  const auto relaxation = MakeNewtonRelaxation(stack, field, wall, {}, terms);
  WireState state = WireState::Along(stack.empty_rod(), {}, poses);
  relaxation->Restart(state);
  REQUIRE(Settle(*relaxation, poses, state, 200).converged);
  InternalForces forces;
  FindInternalForces(relaxation->rods()[0], state, relaxation->Current(), terms, forces);
  HandForces hands;
  Sliding sliding{.coefficient = mu};
  sliding.direction[0][1] = way;
  hands.Find(relaxation->rods(), state, relaxation->Current(), forces, sliding);
  const double wire_N = hands.hands()[0].axial_N;
  const double catheter_N = hands.hands()[1].axial_N;
  INFO("mu " << mu << " segment " << segment_mm << " way " << way);
  CHECK(wire_N ==
        Approx(-kForce * std::exp(-way * mu * angle)).epsilon(1e-3 + 0.02 * mu * segment_mm));
  // Friction between the instruments is internal: the sum of all hand forces does not contain it.
  CHECK(wire_N + catheter_N ==
        Approx(-kForce * std::cos(angle) - kStiff / (2 * kRing * kRing)).epsilon(2e-3));
}

}  // namespace
}  // namespace torquer::test
