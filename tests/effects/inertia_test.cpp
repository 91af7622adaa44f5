// Inertia and drag: oscillating beams, whipping tips, and the time in a tick of several parts.
#include "host/simulator/effects/loads/inertia.h"

#include <catch2/catch.hpp>
#include <numbers>
#include <random>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kRod_mm = 50;
constexpr double kRod_N_mm2 = 2;  // N mm^2
constexpr double kDensity = 1;    // g/m
constexpr double kMass = 1e-9;    // the same in N s^2/mm^2

effects::Inertia::Settings Matter(double density_g_m, double drag_mPa_s) {
  effects::Inertia::Settings settings;
  settings.linear_density_g_m = {density_g_m};
  settings.drag_mPa_s = drag_mPa_s;
  return settings;
}

// A straight beam in a massless fluid, pulled aside by a force at its end and released.
struct Swing {
  WireModel model;
  FreeSpace field;
  WallModel wall;
  effects::Inertia inertia;
  EndForce force{Vector3d::Zero()};
  std::vector<EnergyTerm*> terms{&inertia, &force};
  NewtonRelaxation relaxation;
  WireState state;

  Swing(double drag_mPa_s, double load, double segment_mm = 1)
      : model(MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = kRod_N_mm2})),
        inertia(Matter(kDensity, drag_mPa_s), {model, wall}),
        relaxation(model, field, wall, {.tolerance = 1e-9}, terms),
        state(LayStraight(model, kRod_mm)) {
    force.SetForce({0, load * kRod_N_mm2 / (kRod_mm * kRod_mm), 0});
    relaxation.Restart(state);
    REQUIRE(Settle(relaxation, {kRod_mm, 0}, state).converged);
    force.SetForce(Vector3d::Zero());
  }
  TickReport Tick(double step_s) {
    inertia.AdvanceTime(step_s);
    CountedBudget budget(1000);
    const TickReport report = relaxation.Tick({kRod_mm, 0}, budget, state);
    REQUIRE(report.converged);
    return report;
  }
  double kinetic_mJ() const { return inertia.Readings()[0].value; }
};

// Frequency and decay of an oscillation, fitted to y(t + step) = a y(t) - b y(t - step).
struct Mode {
  double rad_s;
  double decay_1_s;
};

Mode Fit(const std::vector<double>& y, double step_s) {
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  Eigen::Vector2d right = Eigen::Vector2d::Zero();
  for (std::size_t k = 1; k + 1 < y.size(); ++k) {
    const Eigen::Vector2d row(y[k], -y[k - 1]);
    square += row * row.transpose();
    right += y[k + 1] * row;
  }
  const Eigen::Vector2d ab = square.inverse() * right;
  const double modulus = std::sqrt(ab[1]);
  return {std::acos(ab[0] / (2 * modulus)) / step_s, -std::log(modulus) / step_s};
}

// Amplitude of the lowest mode of an Euler-Bernoulli cantilever; other modes are filtered out.
double InLowestMode(const WireState& state) {
  double sum = 0;
  for (int i = 1; i <= state.segments(); ++i) {
    const double x = 1.875104 * i / state.segments();
    const double shape = std::cosh(x) - std::cos(x) - 0.734096 * (std::sinh(x) - std::sin(x));
    const double weight = i == state.segments() ? 0.5 : 1;
    sum += weight * shape * state.nodes()[static_cast<std::size_t>(i)][1];
  }
  return sum / state.segments();
}

Mode Measure(double drag_mPa_s, double step_s, double segment_mm = 1) {
  Swing swing(drag_mPa_s, 0.02, segment_mm);
  std::vector<double> y;
  for (int k = 1; k * step_s < 0.12; ++k) {
    swing.Tick(step_s);
    y.push_back(InLowestMode(swing.state));
  }
  return Fit(y, step_s);
}

// Euler-Bernoulli cantilever.
const double kFirst_rad_s =
    1.875104 * 1.875104 / (kRod_mm * kRod_mm) * std::sqrt(kRod_N_mm2 / kMass);

TEST_CASE("A cantilever swings with the frequency of Euler and Bernoulli's beam") {
  CHECK(kFirst_rad_s / (2 * std::numbers::pi) == Approx(10.01).epsilon(1e-3));
  for (const double step_s : {4e-3, 2e-3, 1e-3}) {
    const Mode mode = Measure(0, step_s);
    // An implicit Euler step multiplies a mode by 1 / (1 - i w step).
    const double turn = kFirst_rad_s * step_s;
    INFO("step " << step_s << ", " << mode.rad_s / kFirst_rad_s << " of the frequency, decay "
                 << mode.decay_1_s);
    CHECK(mode.rad_s == Approx(std::atan(turn) / step_s).epsilon(2e-3));
    CHECK(mode.decay_1_s == Approx(std::log1p(turn * turn) / 2 / step_s).epsilon(1e-2));
  }
}

TEST_CASE("The frequency converges with the segments to second order") {
  constexpr double kStep_s = 2e-3;
  const double exact = std::atan(kFirst_rad_s * kStep_s) / kStep_s;
  const double coarse = Measure(0, kStep_s, 5).rad_s / exact - 1;
  const double fine = Measure(0, kStep_s, 2.5).rad_s / exact - 1;
  INFO(coarse << " " << fine);
  CHECK(std::abs(coarse) < 0.02);
  CHECK(std::abs(fine) < 0.3 * std::abs(coarse));
}

TEST_CASE("Drag lets a swing decay as c / 2 m") {
  constexpr double kDrag_mPa_s = 40;
  const double exact = kDrag_mPa_s * 1e-9 / kMass / 2;
  const double coarse = Measure(kDrag_mPa_s, 5e-4).decay_1_s;
  const double fine = Measure(kDrag_mPa_s, 2.5e-4).decay_1_s;
  INFO(coarse << " " << fine << " towards " << exact);
  CHECK(2 * fine - coarse == Approx(exact).epsilon(0.01));
}

TEST_CASE("A drag that swallows the swing lets the beam creep back") {
  // c y' = -EI y'''': without mass the lowest mode decays at EI k^4 / c.
  constexpr double kDrag_mPa_s = 1e5;
  Swing swing(kDrag_mPa_s, 0.02);
  const double rate = kFirst_rad_s * kFirst_rad_s * kMass / (kDrag_mPa_s * 1e-9);
  const double step_s = 0.02 / rate;
  for (int k = 0; k < 20; ++k) swing.Tick(step_s);
  const double before_mm = swing.state.tip()[1];
  for (int k = 0; k < 50; ++k) swing.Tick(step_s);
  CHECK(std::log(before_mm / swing.state.tip()[1]) == Approx(50 * std::log1p(0.02)).epsilon(0.01));
}

TEST_CASE("Without a hand the energy never rises, and the loss of a step falls with the step") {
  double lost[2];
  int n = 0;
  for (const double step_s : {1e-3, 5e-4}) {
    Swing swing(0, 3);
    double before = swing.relaxation.Current().energy_mJ;
    before += 3 * kRod_N_mm2 / (kRod_mm * kRod_mm) * swing.state.tip()[1];  // force potential
    const double start = before;
    for (int k = 1; k * step_s < 0.1; ++k) {
      const double now = swing.Tick(step_s).energy_mJ + swing.kinetic_mJ();
      CHECK(now <= before * (1 + 1e-9));
      before = now;
    }
    lost[n++] = std::log(start / before);
  }
  INFO(lost[0] << " " << lost[1]);
  CHECK(lost[0] < 1);
  CHECK(lost[0] / lost[1] == Approx(2).epsilon(0.25));
}

// Fed while it oscillates, by `feed_mm` per tick, in parts of at most `max_feed_mm`.
Vector3d FedSwing(double tick_s, double feed_mm, double max_feed_mm) {
  const WireModel model = MakeWire({.segment_mm = 1, .rigidity_N_mm2 = kRod_N_mm2});
  const FreeSpace field;
  const WallModel wall;
  effects::Inertia inertia(Matter(kDensity, 0), {model, wall});
  EndForce force({0, 0.5 * kRod_N_mm2 / (kRod_mm * kRod_mm), 0});
  const std::vector<EnergyTerm*> terms{&inertia, &force};
  NewtonRelaxation relaxation(
      model, field, wall, {.tolerance = 1e-9, .max_feed_mm = max_feed_mm, .part_tolerance = 1e-9},
      terms);
  WireState state = LayStraight(model, kRod_mm);
  relaxation.Restart(state);
  Settle(relaxation, {kRod_mm, 0}, state);
  force.SetForce(Vector3d::Zero());
  for (int k = 1; k * feed_mm < 8 + 1e-9; ++k) {
    inertia.AdvanceTime(tick_s);
    CountedBudget budget(1000);
    const TickReport report = relaxation.Tick({kRod_mm + k * feed_mm, 0}, budget, state);
    REQUIRE(report.converged);
  }
  return state.tip();
}

TEST_CASE("A tick in parts shares its time out over them") {
  // 8 mm in 0.032 s: parts of 0.25 mm are steps of 1 ms, however many parts a tick has.
  const Vector3d one = FedSwing(1e-3, 0.25, 0.25);
  CHECK((FedSwing(4e-3, 1, 0.25) - one).norm() < 1e-6);
  CHECK((FedSwing(3.2e-2, 8, 0.25) - one).norm() < 1e-6);
  // With refinement the motion converges to first order in the step.
  const Vector3d half = FedSwing(4e-3, 1, 0.125);
  const Vector3d fine = FedSwing(4e-3, 1, 0.03125);
  INFO(one.transpose() << ", " << half.transpose() << ", " << fine.transpose());
  CHECK((one - fine).norm() < 0.5);
  CHECK((one - fine).norm() / (half - fine).norm() == Approx(7.0 / 3).epsilon(0.15));
}

TEST_CASE("The time of a tick that a budget ends is not lost") {
  Swing whole(0, 0.5);
  Swing cut(0, 0.5);
  constexpr double kStep_s = 1e-3;
  whole.Tick(kStep_s);
  cut.inertia.AdvanceTime(kStep_s);
  for (int k = 0; k < 10; ++k) {
    CountedBudget one(1);
    if (cut.relaxation.Tick({kRod_mm, 0}, one, cut.state).converged) break;
  }
  CHECK(HashState(cut.state) == HashState(whole.state));
  CHECK(cut.kinetic_mJ() == whole.kinetic_mJ());
  CHECK(cut.kinetic_mJ() > 0);
}

TEST_CASE("Velocities go with the material, also out of the sheath") {
  // A straight wire fed at constant speed moves as a rigid body: no force acts on it.
  const int points = GENERATE(1, 2, 4);
  const WireModel model = MakeWire({.segment_mm = 1, .rigidity_N_mm2 = kRod_N_mm2});
  const FreeSpace field;
  const WallModel wall{.points_per_segment = points};
  effects::Inertia inertia(Matter(kDensity, 0), {model, wall});
  const std::vector<EnergyTerm*> terms{&inertia};
  NewtonRelaxation relaxation(model, field, wall, {.tolerance = 1e-9}, terms);
  WireState state = LayStraight(model, 20);
  relaxation.Restart(state);
  constexpr double kSpeed_mm_s = 37;
  for (int k = 1; k <= 60; ++k) {
    inertia.AdvanceTime(2e-3);
    CountedBudget budget(100);
    const double fed_mm = kSpeed_mm_s * 2e-3 * k;
    REQUIRE(relaxation.Tick({20 + fed_mm, 0}, budget, state).converged);
    if (k == 1) continue;  // from rest
    // The trapezoidal rule assigns half a piece to the sheath.
    const double moving_mm = state.insertion_mm() - state.first_segment_mm() / points / 2;
    CHECK(inertia.Readings()[0].value ==
          Approx(kMass * moving_mm * kSpeed_mm_s * kSpeed_mm_s / 2).epsilon(1e-6));
    CHECK(relaxation.Current().dissipated_mJ < 1e-12);
  }
}

TEST_CASE("The energy of a step agrees with its gradient and Hessian") {
  std::mt19937 random(3);
  const WireModel model = MakeWire({.segment_mm = 1, .rigidity_N_mm2 = 1e-6});
  const FreeSpace field;
  const WallModel wall;
  effects::Inertia inertia(Matter(3, 20), {model, wall});
  const std::vector<EnergyTerm*> terms{&inertia};
  WireMechanics mechanics(model, field, wall, terms);
  QuadraticModel quadratic = mechanics.MakeQuadraticModel();
  // One completed step that moved the wire, and a second that is in progress.
  mechanics.BuildModel(Wander(model, 8, 0.2, random), quadratic);
  inertia.Begin(quadratic.points);
  inertia.End(quadratic.points);
  inertia.AdvanceTime(1e-3);
  inertia.Begin(quadratic.points);
  mechanics.BuildModel(Wander(model, 8, 0.2, random), quadratic);
  inertia.End(quadratic.points);
  inertia.AdvanceTime(2e-3);
  inertia.Begin(quadratic.points);
  const WireState state = Wander(model, 8.3, 0.2, random);
  const auto energy = [&](const Eigen::VectorXd& x) {
    QuadraticModel at = mechanics.MakeQuadraticModel();
    mechanics.BuildModel(Stepped(model, state, Steps(x)), at);
    return at.energy_mJ;
  };
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(2 * state.segments());
  mechanics.BuildModel(state, quadratic);
  const Eigen::VectorXd differences = GradientOf(energy, zero, 1e-3);
  for (int i = 0; i < state.segments(); ++i) {
    CHECK((quadratic.gradient[static_cast<std::size_t>(i)] - differences.segment<2>(2 * i)).norm() <
          1e-8 * differences.norm());
  }
  // The sweep's Newton step solves the dense system from finite differences.
  RiccatiSweep<BendStage> sweep(model.max_segments());
  REQUIRE(sweep.Factor(model, state, quadratic, 0));
  std::vector<Vector2d> step;
  std::vector<double> spin;
  std::vector<Vector3d> moved;
  sweep.Step(model, state, quadratic, step, spin, moved);
  const Eigen::VectorXd dense =
      HessianOf(energy, zero, 3e-3).ldlt().solve(Eigen::VectorXd(-differences));
  for (int i = 0; i < state.segments(); ++i) {
    CHECK((step[static_cast<std::size_t>(i)] - dense.segment<2>(2 * i)).norm() <
          1e-4 * dense.norm());
  }
}

// A bent tip in a bent vessel. The hand turns it in 40 ms past the place where it whips round, and
// then holds. The vessel rests.
struct Whip {
  static constexpr double kInside = 80;
  static constexpr double kTurn_rad = 3.9;
  WireModel model;
  Torus field{Side::kInside, 30, 3};
  WallModel wall{.stiffness_N_mm2 = 0.5};
  effects::Inertia inertia;
  std::vector<EnergyTerm*> terms{&inertia};
  std::unique_ptr<Relaxation> relaxation;
  WireState state;

  Whip()
      : model(MakeWire({.segment_mm = 2,
                        .rigidity_N_mm2 = 1,
                        .torsional_rigidity_N_mm2 = 0.77,
                        .tip_mm = 12,
                        .tip_curvature_1_per_mm = 0.12,
                        .max_length_mm = 150,
                        .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}})),
        inertia(Matter(5, 40), {model, wall}),
        relaxation(MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-8}, terms)),
        state(model) {
    std::vector<Vector3d> path;
    for (double a = 0.01; a < 4; a += 0.01)
      path.emplace_back(30 * std::cos(a), 30 * std::sin(a), 0);
    state = WireState::Along(model, path, {kInside, 0});
    relaxation->Restart(state);
    REQUIRE(Settle(*relaxation, {kInside, 0}, state).converged);
  }
  // Tip positions every 4 ms.
  std::vector<Vector3d> Run(double step_s, double until_s) {
    std::vector<Vector3d> tips;
    const int every = static_cast<int>(std::lround(4e-3 / step_s));
    for (int k = 1; k * step_s < until_s + 1e-9; ++k) {
      inertia.AdvanceTime(step_s);
      CountedBudget budget(2000);
      const double turned = kTurn_rad * std::min(1.0, k * step_s / 0.04);
      relaxation->Tick({kInside, turned}, budget, state);
      if (k % every == 0) tips.push_back(state.tip());
    }
    return tips;
  }
};

TEST_CASE("A tip that whips round takes the same time and way in any step, to its first order") {
  const auto reference = Whip().Run(3.125e-5, 0.08);
  const auto apart_mm = [&](double step_s) {
    const auto tips = Whip().Run(step_s, 0.08);
    double sum_mm = 0;
    for (std::size_t k = 0; k < tips.size(); ++k) sum_mm += (tips[k] - reference[k]).norm();
    return sum_mm / static_cast<double>(tips.size());
  };
  double apart[3];
  int n = 0;
  for (const double step_s : {1e-3, 2.5e-4, 1.25e-4}) apart[n++] = apart_mm(step_s);
  INFO(apart[0] << " " << apart[1] << " " << apart[2]);
  CHECK(apart[0] < 0.5);
  CHECK(apart[1] / apart[2] == Approx(7.0 / 3).epsilon(0.2));
  // The tip moves for longer than a tick, and overshoots its rest position.
  double most_mm = 0;
  for (std::size_t k = 1; k < reference.size(); ++k) {
    most_mm = std::max(most_mm, (reference[k] - reference[k - 1]).norm());
  }
  CHECK(most_mm < 0.4 * (reference.front() - reference.back()).norm());
}

}  // namespace
}  // namespace torquer::test
