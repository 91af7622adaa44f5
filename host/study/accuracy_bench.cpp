#include "host/study/accuracy_bench.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/vessel/brick_field.h"
#include "host/study/cpu_time.h"
#include "host/study/trilinear_field.h"
#include "host/support/strict_toml.h"

namespace torquer::study {
namespace {

constexpr double kSlipMm = 0.005;
constexpr double kFeedMm = 0.1;          // feed per action of Newton's method: 100 mm/s at 1 kHz
constexpr double kTurnRadPerMm = 0.05;   // the hand turns while it feeds
constexpr double kTight = 1e-9;          // tolerance of references and companions
constexpr double kAnotherBasinMm = 0.5;  // a smaller distance is an error, not another basin
constexpr int kPlenty = 20000;

// Budget by processor time of this thread. The first unit is always granted. Otherwise the wire
// would never move.
class TimedBudget final : public WorkBudget {
 public:
  explicit TimedBudget(double budget_us) : end_s_(ThreadCpuSeconds() + 1e-6 * budget_us) {}
  bool Allows(int done) override { return done == 0 || ThreadCpuSeconds() < end_s_; }

 private:
  double end_s_;
};

// Relaxation by Newton's method with its own friction.
struct NewtonBench {
  NewtonBench(const WireModel& model, const ClearanceField& field, const WallModel& wall_model,
              double coefficient, double tolerance)
      : wall(wall_model),
        friction(coefficient, kSlipMm, {model, wall}),
        terms(coefficient > 0 ? std::vector<EnergyTerm*>{&friction} : std::vector<EnergyTerm*>{}),
        newton(model, field, wall, Settings(tolerance), terms) {}
  static NewtonSettings Settings(double tolerance) {
    NewtonSettings settings;
    settings.tolerance = tolerance;
    return settings;
  }
  // Holds the hand still until the wire is in equilibrium.
  bool Settle(WireState& state) {
    TickReport report;
    for (int k = 0; k < 5 && !report.converged; ++k) {
      CountedBudget budget(kPlenty);
      report = newton.Tick({state.insertion_mm(), state.rotation_rad()}, budget, state);
    }
    return report.converged;
  }
  const WallModel wall;
  effects::Friction friction;
  const std::vector<EnergyTerm*> terms;
  NewtonRelaxation newton;
};

// Advances by `stretch_mm` in actions of kFeedMm. Returns the number of ticks without convergence.
int Advance(NewtonBench& bench, double stretch_mm, WireState& state) {
  const InstrumentPose from = state.poses()[0];
  const int actions = static_cast<int>(std::lround(stretch_mm / kFeedMm));
  int unconverged = 0;
  for (int k = 1; k <= actions; ++k) {
    const double fed = stretch_mm * k / actions;
    CountedBudget budget(kPlenty);
    unconverged += !bench.newton
                        .Tick({from.insertion_mm + fed, from.rotation_rad + kTurnRadPerMm * fed},
                              budget, state)
                        .converged;
  }
  return unconverged;
}

}  // namespace

double AccuracyOutcome::Quantile(double q) const {
  if (action_ms.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> sorted = action_ms;
  std::sort(sorted.begin(), sorted.end());
  return sorted[static_cast<std::size_t>(q * static_cast<double>(sorted.size() - 1))];
}

double AccuracyOutcome::MsPerMm() const {
  double sum = 0;
  for (const double ms : action_ms) sum += ms;
  return sum / fed_mm;
}

AccuracyBench::AccuracyBench(const std::string& scene_path, std::vector<double> places_mm,
                             const Options& options)
    // None of the methods that are compared twists the wire.
    : scene_(std::make_unique<scene::Scene>(
          scene::With(scene::ReadScene(scene_path), {{"effects.torsion", false}}))),
      options_(options),
      places_mm_(std::move(places_mm)) {
  StrictTable file = StrictTable::Read(scene_path);
  StrictTable* all = file.OptionalTable("effects");
  StrictTable* friction = all != nullptr ? all->OptionalTable("friction") : nullptr;
  if (friction != nullptr) scene_friction_ = friction->Number("coefficient", 0, 2);

  const std::unique_ptr<Relaxation> relaxation = scene_->MakeRelaxation();
  WireState state = scene_->MakeStart(*relaxation);
  for (const double place : places_mm_) {
    assert(place >= state.insertion_mm());
    while (state.insertion_mm() < place) {
      CountedBudget budget(scene_->budget_units());
      relaxation->Tick({std::min(place, state.insertion_mm() + 0.5), 0}, budget, state);
    }
    approached_.push_back(state);
  }
}

double AccuracyBench::Friction(const AccuracyCase& c) const {
  if (c.method == AccuracyMethod::kPaper) return 0;
  return c.friction.value_or(scene_friction_);
}

WallModel AccuracyBench::Wall(const AccuracyCase& c) const {
  return {scene_->wall().stiffness_N_mm2, c.contact_points};
}

const ClearanceField& AccuracyBench::Field(FieldKind kind, double voxel_mm) {
  if (kind == FieldKind::kScene) return *scene_->vessel().field;
  std::unique_ptr<ClearanceField>& field =
      fields_[(kind == FieldKind::kSpline ? "spline" : "linear") + std::to_string(voxel_mm)];
  if (field != nullptr) return *field;
  const vessel::Vessel& vessel = scene_->vessel();
  if (kind == FieldKind::kTrilinear) {
    field = std::make_unique<TrilinearField>(Field(FieldKind::kSpline, options_.finest_voxel_mm),
                                             voxel_mm);
    return *field;
  }
  vessel::BrickFieldOptions options;
  options.voxel_mm = voxel_mm;
  std::shared_ptr<const vessel::DistanceSource> source;
  if (vessel.surface != nullptr) {
    source = {vessel.surface, &vessel.surface->surface()};
  } else {
    const std::shared_ptr<const ClearanceField> smooth = vessel.field;
    source = std::make_shared<vessel::FunctionSource>(
        [smooth](const Eigen::Vector3d& p) { return smooth->Clearance(p); });
  }
  field = std::make_unique<vessel::BrickField>(source, vessel.bounds_mm, options);
  return *field;
}

const AccuracyBench::Reference& AccuracyBench::ReferenceFor(const AccuracyCase& c) {
  const double friction = Friction(c);
  Reference& reference = references_[std::to_string(friction) + "/" +
                                     std::to_string(static_cast<int>(c.against_finest_field))];
  if (reference.model != nullptr) return reference;
  const ClearanceField& field = c.against_finest_field
                                    ? Field(FieldKind::kSpline, options_.finest_voxel_mm)
                                    : Field(FieldKind::kScene, 0);
  reference.model = scene_->MakeWire(options_.reference_segment_mm, BendingLaw::kExact);
  for (const WireState& approached : approached_) {
    WireState state = Recut(*reference.model, approached);
    NewtonBench bench(*reference.model, field, {scene_->wall().stiffness_N_mm2, 2}, friction,
                      kTight);
    bench.newton.Restart(state);
    bench.Settle(state);
    reference.start.push_back(state);
    bench.newton.Restart(state);
    reference_unconverged_ += Advance(bench, options_.stretch_mm, state);
    reference.end.push_back(state);
  }
  return reference;
}

const AccuracyBench::Companion& AccuracyBench::CompanionFor(const AccuracyCase& c,
                                                            const Reference& reference) {
  std::string key = std::to_string(Friction(c));
  for (const double setting :
       {c.segment_mm, static_cast<double>(c.law), static_cast<double>(c.contact_points),
        static_cast<double>(c.field), c.voxel_mm, static_cast<double>(c.against_finest_field)}) {
    key += "/" + std::to_string(setting);
  }
  Companion& companion = companions_[key];
  if (!companion.end.empty()) return companion;
  const std::unique_ptr<WireModel> model = scene_->MakeWire(c.segment_mm, c.law);
  const ClearanceField& field = Field(c.field, c.voxel_mm);
  for (const WireState& start : reference.start) {
    WireState state = Recut(*model, start);
    NewtonBench bench(*model, field, Wall(c), Friction(c), kTight);
    bench.newton.Restart(state);
    bench.Settle(state);
    bench.newton.Restart(state);
    Advance(bench, options_.stretch_mm, state);
    companion.energy_mJ.push_back(Energy(c, *model, state));
    companion.end.push_back(std::move(state));
  }
  return companion;
}

// Bending and wall energy, with the case's own field and wall model.
double AccuracyBench::Energy(const AccuracyCase& c, const WireModel& model,
                             const WireState& state) {
  const std::vector<EnergyTerm*> none;
  const WallModel wall = Wall(c);
  WireMechanics mechanics(model, Field(c.field, c.voxel_mm), wall, none);
  QuadraticModel quadratic = mechanics.MakeQuadraticModel();
  mechanics.BuildGradient(state, quadratic);
  return quadratic.energy_mJ;
}

double AccuracyBench::Expected(const AccuracyCase& c) const {
  // A PR cycle of 250 segments takes 15 ms and grows with the cube of n. A Newton action takes 0.3
  // ms.
  double seconds = 0;
  for (const double place : places_mm_) {
    const double n = place / c.segment_mm / 250;
    if (c.method == AccuracyMethod::kPaper) {
      seconds +=
          options_.stretch_mm / c.segment_mm * (1e-4 * n + 0.015 * c.cycle_count * n * n * n);
    } else {
      seconds += options_.stretch_mm / kFeedMm * 3e-4 * n;
    }
  }
  return seconds;
}

AccuracyOutcome AccuracyBench::Measure(const AccuracyCase& c) {
  const Reference& reference = ReferenceFor(c);
  const Companion& companion = CompanionFor(c, reference);
  const std::unique_ptr<WireModel> model = scene_->MakeWire(c.segment_mm, c.law);
  const ClearanceField& field = Field(c.field, c.voxel_mm);
  const bool by_paper = c.method == AccuracyMethod::kPaper;
  const double step_mm = by_paper ? c.segment_mm : kFeedMm;
  const int actions = static_cast<int>(std::lround(options_.stretch_mm / step_mm));

  AccuracyOutcome outcome;
  int compared = 0;
  double gap_mJ = 0;
  double energy_mJ = 0;
  for (std::size_t place = 0; place < reference.start.size(); ++place) {
    WireState state = Recut(*model, reference.start[place]);
    const InstrumentPose from = state.poses()[0];
    NewtonBench bench(*model, field, Wall(c), Friction(c), c.tolerance);
    std::unique_ptr<PaperRelaxation> paper;
    Relaxation* relaxation = &bench.newton;
    if (by_paper) {
      PaperSettings settings;
      settings.cycles = c.cycles;
      settings.physical.rule = c.rule;
      settings.tolerance = 1e-12;
      paper = std::make_unique<PaperRelaxation>(*model, field, bench.wall, settings);
      relaxation = paper.get();
    }
    relaxation->Restart(state);
    if (!by_paper) {
      bench.Settle(state);
      relaxation->Restart(state);
    }
    for (int k = 1; k <= actions; ++k) {
      const double fed = step_mm * k;
      const InstrumentPoses target{from.insertion_mm + fed,
                                   from.rotation_rad + kTurnRadPerMm * fed};
      const double start_s = ThreadCpuSeconds();
      TickReport report;
      if (c.method == AccuracyMethod::kNewtonBudget) {
        TimedBudget budget(c.budget_us);
        report = relaxation->Tick(target, budget, state);
      } else {
        for (int round = 0; round < std::max(1, c.cycle_count); ++round) {
          CountedBudget budget(kPlenty);
          report = relaxation->Tick(target, budget, state);
        }
      }
      outcome.action_ms.push_back(1e3 * (ThreadCpuSeconds() - start_s));
      outcome.unconverged += !report.converged;
    }
    outcome.fed_mm += options_.stretch_mm;
    ++outcome.places;

    const QuadraticModel& now = relaxation->Current();
    outcome.residual = std::max(outcome.residual, now.residual);
    outcome.residual_per_length =
        std::max(outcome.residual_per_length, ResidualPerLength(*model, state, now.gradient));
    outcome.penetration_mm =
        std::max(outcome.penetration_mm, DeepestPenetration(*model, field, state));
    const WireState& goal = reference.end[place];
    const WireDistance error = Compare(*model, state, *reference.model, goal);
    if (error.max_mm > kAnotherBasinMm &&
        std::abs(state.insertion_mm() - goal.insertion_mm()) < 1e-6 &&
        !InOneBasin(*model, field, {bench.wall.stiffness_N_mm2, 2}, state, Recut(*model, goal),
                    kAnotherBasinMm)) {
      ++outcome.basin_changes;
      continue;
    }
    ++compared;
    outcome.error_mean_mm += error.mean_mm;
    outcome.error_max_mm = std::max(outcome.error_max_mm, error.max_mm);
    const WireDistance solver = Compare(*model, state, *model, companion.end[place]);
    outcome.solver_error_mean_mm += solver.mean_mm;
    outcome.solver_error_max_mm = std::max(outcome.solver_error_max_mm, solver.max_mm);
    gap_mJ += Energy(c, *model, state) - companion.energy_mJ[place];
    energy_mJ += companion.energy_mJ[place];
  }
  if (compared == 0) {
    const double none = std::numeric_limits<double>::quiet_NaN();
    outcome.error_mean_mm = outcome.error_max_mm = none;
    outcome.solver_error_mean_mm = outcome.solver_error_max_mm = outcome.energy_gap = none;
    return outcome;
  }
  outcome.error_mean_mm /= compared;
  outcome.solver_error_mean_mm /= compared;
  outcome.energy_gap = gap_mJ / energy_mJ;
  return outcome;
}

}  // namespace torquer::study
