#include "host/study/scaling.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/core/paper/paper_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/study/cpu_time.h"
#include "host/study/peers_problem.h"
#include "host/study/quantile.h"
#include "host/study/wires.h"
#include "host/support/machine.h"

namespace torquer::study {
namespace {

constexpr double kFriction = 0.1;
constexpr double kSlipMm = 0.005;
constexpr int kPlenty = 1000000;

// Wire in the T-Y phantom, relaxed by Newton's method.
class NewtonRun {
 public:
  NewtonRun(const vessel::TubeVessel& vessel, const StudyWire& wire, double segment_mm,
            double max_length_mm, double friction)
      : model_(segment_mm, wire.sections, wire.tip_mm, max_length_mm, BendingLaw::kExact,
               {vessel.entry_point_mm(), vessel.entry_direction()}),
        wall_{wire.wall_stiffness_N_mm2, 2},
        friction_(friction, kSlipMm, {model_, wall_}),
        terms_(friction > 0 ? std::vector<EnergyTerm*>{&friction_} : std::vector<EnergyTerm*>{}),
        relaxation_(model_, *vessel.field, wall_, NewtonSettings(), terms_),
        state_(model_) {
    relaxation_.Restart(state_);
  }

  TickReport Feed(double delta_mm) {
    target_[0].insertion_mm += delta_mm;
    CountedBudget budget(kPlenty);
    return relaxation_.Tick(target_, budget, state_);
  }
  void FeedTo(double insertion_mm) {
    while (target_[0].insertion_mm < insertion_mm) {
      Feed(std::min(0.5, insertion_mm - target_[0].insertion_mm));
    }
  }
  const WireState& state() const { return state_; }

 private:
  WireModel model_;
  WallModel wall_;
  effects::Friction friction_;
  std::vector<EnergyTerm*> terms_;
  NewtonRelaxation relaxation_;
  WireState state_;
  InstrumentPoses target_;
};

// Shipped scene with its own vessel, wire, effects and method.
class SceneRun {
 public:
  explicit SceneRun(const std::string& path)
      : scene_(path), relaxation_(scene_.MakeRelaxation()), state_(scene_.MakeStart(*relaxation_)) {
    target_[0].insertion_mm = state_.insertion_mm();
  }
  TickReport Feed(double delta_mm) {
    target_[0].insertion_mm += delta_mm;
    CountedBudget budget(kPlenty);
    return relaxation_->Tick(target_, budget, state_);
  }
  void FeedTo(double insertion_mm) {
    while (target_[0].insertion_mm < insertion_mm) {
      Feed(std::min(0.5, insertion_mm - target_[0].insertion_mm));
    }
  }
  double segment_mm() const { return scene_.stack().empty_rod().segment_mm(); }

 private:
  scene::Scene scene_;
  std::unique_ptr<Relaxation> relaxation_;
  WireState state_;
  InstrumentPoses target_;
};

struct ActionCost {
  std::vector<double> ms;
  int unconverged = 0;
  double iterations = 0;
  double worst_residual = 0;
};

// Measures typical feeds of 0.02, 0.05 and 0.1 mm in turn, in the last stretch before `to_mm`.
template <class AnyRun>
ActionCost MeasureFeeds(AnyRun& run, double to_mm, int actions) {
  constexpr double kFeeds[] = {0.02, 0.05, 0.1};
  run.FeedTo(to_mm - actions * 0.17 / 3);
  ActionCost cost;
  for (int k = 0; k < actions; ++k) {
    const double start_s = ThreadCpuSeconds();
    const TickReport report = run.Feed(kFeeds[k % 3]);
    cost.ms.push_back(1e3 * (ThreadCpuSeconds() - start_s));
    cost.unconverged += !report.converged;
    cost.iterations += report.iterations;
    cost.worst_residual = std::max(cost.worst_residual, report.residual);
  }
  cost.iterations /= actions;
  return cost;
}

// Race: time until the energy reaches that of cycles of the literal method from the same start. The
// start is the wire after 250 insertions with Tip Relaxations only.
class Race {
 public:
  struct Result {
    double ms = 0;
    double energy_mJ = 0;
  };

  Race(const vessel::TubeVessel& vessel, double tip_rad)
      : vessel_(vessel),
        wire_(PaperWire(tip_rad)),
        model_(1, wire_.sections, wire_.tip_mm, 255, BendingLaw::kG1,
               {vessel.entry_point_mm(), vessel.entry_direction()}),
        wall_{wire_.wall_stiffness_N_mm2, 1},
        start_(model_) {
    PaperRelaxation insertion(model_, *vessel_.field, wall_, Settings(PaperCycles::kNone));
    insertion.Restart(start_);
    CountedBudget budget(kPlenty);
    insertion.Tick(Target(), budget, start_);
  }

  Result RunPaper(int cycles) const {
    PaperRelaxation paper(model_, *vessel_.field, wall_, Settings(PaperCycles::kGeometrical));
    WireState state = start_;
    paper.Restart(state);
    Result result{0, paper.Current().energy_mJ};
    const double start_s = ThreadCpuSeconds();
    for (int cycle = 0; cycle < cycles; ++cycle) {
      CountedBudget budget(kPlenty);
      result.energy_mJ = paper.Tick(Target(), budget, state).energy_mJ;
    }
    result.ms = 1e3 * (ThreadCpuSeconds() - start_s);
    return result;
  }

  // Runs Newton's method on the same energy (law and contacts), iteration by iteration.
  Result RunNewton(double energy_mJ) const {
    const std::vector<EnergyTerm*> none;
    std::vector<double> ms;
    Result result;
    for (int repeat = 0; repeat < 5; ++repeat) {
      NewtonRelaxation newton(model_, *vessel_.field, wall_, NewtonSettings(), none);
      WireState state = start_;
      newton.Restart(state);
      const double start_s = ThreadCpuSeconds();
      TickReport report;
      do {
        CountedBudget one(2);
        report = newton.Tick(Target(), one, state);
      } while (report.energy_mJ > energy_mJ && !report.converged);
      ms.push_back(1e3 * (ThreadCpuSeconds() - start_s));
      result.energy_mJ = report.energy_mJ;
    }
    result.ms = Quantile(ms, 0.5);
    return result;
  }

 private:
  static InstrumentPoses Target() { return {250, 0}; }

  static PaperSettings Settings(PaperCycles cycles) {
    PaperSettings settings;
    settings.physical.skip_lookups = false;
    settings.cycles = cycles;
    settings.tolerance = 1e-12;
    return settings;
  }

  const vessel::TubeVessel& vessel_;
  const StudyWire wire_;
  const WireModel model_;
  const WallModel wall_;
  WireState start_;
};

class ScalingStudy final : public Study {
 public:
  std::string name() const override { return "scaling"; }
  std::string title() const override { return "An equilibrium at sensor rate"; }
  std::string summary() const override {
    return "time of one action to equilibrium as a function of n";
  }

  void AddOptions(Options& options) override {
    options.Text("--scenes", "FOLDER", folder_,
                 "folder with the scenes neuro_arch and abdominal_aorta; without it the scenes "
                 "that Torquer ships",
                 ValueKind::kFolder);
  }

  bool Run(StudyRun& run) override {
    folder_ = SceneFolder(folder_);
    for (const char* scene : {"neuro_arch", "abdominal_aorta"}) RequireScene(folder_, scene);
    const vessel::TubeVessel vessel = vessel::MakeTyPhantom();
    table_ = {
        "One action (feeds of 0.02, 0.05 and 0.1 mm) to residual 1e-6, thread-CPU time",
        {"case", "median ms", "p99 ms", "max ms", "iterations", "unconverged", "worst residual"},
        {}};
    const int actions = run.quick() ? 150 : 600;
    const double tip = std::numbers::pi / 6;
    run.Say(DescribeMachine());
    run.Progress("actions", 0);
    Measure(run, vessel, "newton/friction/n=250", PaperWire(tip), 1, kFriction, actions);
    Measure(run, vessel, "newton/frictionless/n=250", PaperWire(tip), 1, 0, actions);
    run.Progress("real wires", 0.2);
    Measure(run, vessel, "newton/wire014/n=250", Wire014(), 1, kFriction, actions);
    Measure(run, vessel, "newton/wire035/n=250", Wire035(), 1, kFriction, actions);
    run.Progress("n = 2500", 0.3);
    Measure(run, vessel, "newton/friction/n=2500", PaperWire(tip), 0.1, kFriction,
            run.quick() ? 60 : actions);
    run.Progress("real vessels", 0.35);
    MeasureScene(run, "neuro_arch", 450, actions);
    MeasureScene(run, "abdominal_aorta", 200, actions);
    run.Section("Time of an action");
    run.Show(table_);
    MeasureGrowth(run, vessel, tip);
    MeasureWholeInsertion(run, vessel, tip);
    MeasurePeersProblem(run);
    CompareWithPaper(run, vessel);
    return true;
  }

 private:
  void Measure(StudyRun& run, const vessel::TubeVessel& vessel, const std::string& name,
               const StudyWire& wire, double segment_mm, double friction, int actions) {
    NewtonRun newton(vessel, wire, segment_mm, 255, friction);
    Add(run, name, MeasureFeeds(newton, 250, actions));
  }

  // Measures a shipped scene with `n` segments inserted.
  void MeasureScene(StudyRun& run, const std::string& scene, int n, int actions) {
    SceneRun session(folder_ + "/" + scene + ".toml");
    Add(run, "newton/" + scene + "/n=" + std::to_string(n),
        MeasureFeeds(session, n * session.segment_mm(), actions));
  }

  void Add(StudyRun& run, const std::string& name, const ActionCost& cost) {
    const double median = Quantile(cost.ms, 0.5);
    const double p99 = Quantile(cost.ms, 0.99);
    const double max = Quantile(cost.ms, 1);
    run.Record(name, "ms_p50", median, "ms");
    run.Record(name, "ms_p99", p99, "ms");
    run.Record(name, "ms_max", max, "ms");
    run.Record(name, "unconverged", cost.unconverged, "");
    run.Record(name, "iterations", cost.iterations, "");
    run.Record(name, "residual_max", cost.worst_residual, "");
    table_.rows.push_back({name, Number(median), Number(p99), Number(max), Number(cost.iterations),
                           std::to_string(cost.unconverged), Number(cost.worst_residual)});
  }

  // Measures the same wire at the same insertion with ever finer segments. Fits ms = a n^exponent
  // by least squares.
  static void MeasureGrowth(StudyRun& run, const vessel::TubeVessel& vessel, double tip) {
    Series series{"median", Mark::kLineAndPoints, {}, {}};
    double sx = 0;
    double sy = 0;
    double sxx = 0;
    double sxy = 0;
    for (const int n : {250, 500, 1000, 2500}) {
      run.Progress("growth, n = " + std::to_string(n), 0.4);
      const double segment_mm = 250.0 / n;
      NewtonRun newton(vessel, PaperWire(tip), segment_mm, 255, kFriction);
      const ActionCost cost = MeasureFeeds(newton, 250, run.quick() ? 45 : 150);
      const double median = Quantile(cost.ms, 0.5);
      run.Record("growth/n=" + std::to_string(n), "ms_p50", median, "ms");
      series.x.push_back(n);
      series.y.push_back(median);
      const double x = std::log(n);
      const double y = std::log(median);
      sx += x;
      sy += y;
      sxx += x * x;
      sxy += x * y;
    }
    const auto count = static_cast<double>(series.x.size());
    const double exponent = (count * sxy - sx * sy) / (count * sxx - sx * sx);
    run.Record("growth", "exponent", exponent, "");
    Plot plot{"Time of an action over the number of segments",
              {"segments n", true},
              {"median time of an action, ms", true},
              {series}};
    run.Section("Growth with n");
    run.Draw(plot, "The same 250 mm of wire in 250 to 2500 segments: the sweep is linear in n.");
    run.Say("Time of an action grows with n to the power of " + Number(exponent) + ".");
  }

  static void MeasureWholeInsertion(StudyRun& run, const vessel::TubeVessel& vessel, double tip) {
    run.Progress("whole insertion", 0.6);
    std::vector<double> totals;
    for (int repeat = 0; repeat < 5; ++repeat) {
      NewtonRun newton(vessel, PaperWire(tip), 1, 255, kFriction);
      newton.FeedTo(7);
      const double start_s = ThreadCpuSeconds();
      for (int n = 8; n <= 250; ++n) newton.Feed(1);
      totals.push_back(1e3 * (ThreadCpuSeconds() - start_s));
    }
    const double total = Quantile(totals, 0.5);
    run.Record("whole_insertion", "ms_total", total, "ms");
    run.Say("The whole insertion, n = 7 to 250 with an equilibrium every millimeter: " +
            Number(total) + " ms.");
  }

  static void CompareWithPaper(StudyRun& run, const vessel::TubeVessel& vessel) {
    Table table{
        "To the energy that 100 cycles of PR + GR reach, n = 250, the same field",
        {"tip", "PR + GR, literal, ms", "newton, ms", "ratio", "energy after, mJ", "newton's, mJ"},
        {}};
    const int cycles = run.quick() ? 10 : 100;
    double lowest = std::numeric_limits<double>::infinity();
    for (const double degrees : {0.0, 45.0}) {
      run.Progress("against the paper", degrees == 0 ? 0.7 : 0.85);
      const Race race(vessel, degrees * std::numbers::pi / 180);
      const Race::Result paper = race.RunPaper(cycles);
      const Race::Result newton = race.RunNewton(paper.energy_mJ);
      const double ratio = paper.ms / newton.ms;
      const std::string name = "against_paper/tip=" + Number(degrees);
      run.Record(name, "paper_ms", paper.ms, "ms");
      run.Record(name, "newton_ms", newton.ms, "ms");
      run.Record(name, "ratio", ratio, "");
      run.Record(name, "cycles", cycles, "");
      run.Record(name, "paper_energy", paper.energy_mJ, "mJ");
      run.Record(name, "newton_energy", newton.energy_mJ, "mJ");
      table.rows.push_back({Number(degrees) + " deg", Number(paper.ms), Number(newton.ms),
                            Number(ratio), Number(paper.energy_mJ, 6),
                            Number(newton.energy_mJ, 6)});
      lowest = std::min(lowest, ratio);
    }
    run.Record("against_paper", "ratio", lowest, "");
    run.Section("Comparison with the paper's method");
    run.Show(table);
    if (run.quick()) run.Say("Quick run: 10 cycles instead of 100.");
  }

  std::string folder_;
  Table table_;
};

}  // namespace

std::unique_ptr<Study> MakeScalingStudy() { return std::make_unique<ScalingStudy>(); }

}  // namespace torquer::study
