#include "host/study/peers_problem.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/effects/contact/friction.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cpu_time.h"
#include "host/study/quantile.h"
#include "host/study/wires.h"

namespace torquer::study {
namespace {

constexpr double kLengthMm = 250;
constexpr double kRowMm = 0.5;

// Cost of a motion, row by row.
struct MotionCost {
  std::vector<double> ms;
  int unconverged = 0;
  double worst_residual = 0;
};

class PeersProblem {
 public:
  explicit PeersProblem(int segments)
      : model_(kLengthMm / segments, Sections(), PaperWire(0).tip_mm, kLengthMm + 1,
               BendingLaw::kExact, {Eigen::Vector3d(kRingMm, 0, 0), Eigen::Vector3d::UnitY()}),
        relaxation_(model_, field_, wall_, NewtonSettings(), terms_),
        state_(model_) {
    relaxation_.Restart(state_);
  }

  // Moves the wire to `to_mm` by rows, and adds them to `cost`.
  void MoveTo(double to_mm, MotionCost& cost) {
    const double from_mm = insertion_mm_;
    const int rows = static_cast<int>(std::lround(std::abs(to_mm - from_mm) / kRowMm));
    for (int row = 1; row <= rows; ++row) {
      insertion_mm_ = from_mm + (to_mm - from_mm) * row / rows;
      CountedBudget budget(kPlenty);
      const double start_s = ThreadCpuSeconds();
      const TickReport report = relaxation_.Tick({insertion_mm_, 0}, budget, state_);
      cost.ms.push_back(1e3 * (ThreadCpuSeconds() - start_s));
      cost.unconverged += !report.converged;
      cost.worst_residual = std::max(cost.worst_residual, report.residual);
    }
  }

 private:
  static constexpr double kRingMm = 160;
  static constexpr int kPlenty = 1000000;
  static std::vector<WireSection> Sections() { return PaperWire(0).sections; }

  Torus field_{Side::kInside, kRingMm, 3};
  WallModel wall_{.stiffness_N_mm2 = 1, .points_per_segment = 2};
  WireModel model_;
  effects::Friction friction_{0.1, 0.005, {model_, wall_}};
  std::vector<EnergyTerm*> terms_{&friction_};
  NewtonRelaxation relaxation_;
  WireState state_;
  double insertion_mm_ = 0;
};

}  // namespace

void MeasurePeersProblem(StudyRun& run) {
  Table table{
      "A row of 0.5 mm to residual 1e-6, thread-CPU time",
      {"segments", "motion", "median ms", "p99 ms", "max ms", "unconverged", "worst residual"},
      {}};
  for (const int n : {100, 250}) {
    run.Progress("the peers' problem, n = " + std::to_string(n), n == 100 ? 0.9 : 0.92);
    PeersProblem problem(n);
    const auto add = [&](const std::string& motion, const MotionCost& cost) {
      const std::string name = "peers/n=" + std::to_string(n) + "/" + motion;
      const double median = Quantile(cost.ms, 0.5);
      const double p99 = Quantile(cost.ms, 0.99);
      const double max = Quantile(cost.ms, 1);
      run.Record(name, "ms_p50", median, "ms");
      run.Record(name, "ms_p99", p99, "ms");
      run.Record(name, "ms_max", max, "ms");
      run.Record(name, "unconverged", cost.unconverged, "");
      run.Record(name, "residual_max", cost.worst_residual, "");
      table.rows.push_back({std::to_string(n), motion, Number(median), Number(p99), Number(max),
                            std::to_string(cost.unconverged), Number(cost.worst_residual)});
    };
    constexpr double kLastMm = 50;
    constexpr double kBackMm = 12.5;
    MotionCost insertion;
    problem.MoveTo(kLengthMm - kLastMm, insertion);
    MotionCost last;
    problem.MoveTo(kLengthMm, last);
    insertion.ms.insert(insertion.ms.end(), last.ms.begin(), last.ms.end());
    insertion.unconverged += last.unconverged;
    insertion.worst_residual = std::max(insertion.worst_residual, last.worst_residual);
    MotionCost strokes;
    for (int stroke = 0; stroke < 10; ++stroke) {
      problem.MoveTo(kLengthMm - kBackMm, strokes);
      problem.MoveTo(kLengthMm, strokes);
    }
    add("insertion from 0 to 250 mm", insertion);
    add("its last 50 mm", last);
    add("ten times 250 - 237.5 - 250 mm", strokes);
  }
  run.Section("The problem of peers.md");
  run.Show(table);
}

}  // namespace torquer::study
