#include "host/study/twist.h"

#include <algorithm>
#include <string>
#include <vector>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/simple_wire.h"
#include "host/study/cpu_time.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

constexpr double kRingMm = 30;
constexpr double kFedMm = 70;
constexpr double kSteel = 0.77;  // GJ / EI
constexpr double kStiffest = 1000;

// Wire with a bent tip, fed around a bend and turned there by half a turn.
struct Journey {
  std::vector<std::vector<Vector3d>> nodes_mm;  // nodes at every tenth of a radian
  double ms = 0;
  int iterations = 0;
  int unconverged = 0;
};

// `ratio`: GJ / EI; 0: a wire rigid in torsion.
Journey Travel(double ratio, double tip_curvature_1_per_mm) {
  const WireModel model = MakeWire({.rigidity_N_mm2 = 1,
                                    .torsional_rigidity_N_mm2 = ratio,
                                    .tip_mm = 12,
                                    .tip_curvature_1_per_mm = tip_curvature_1_per_mm,
                                    .sheath = {Vector3d(kRingMm, 0, 0), Vector3d::UnitY()}});
  const Torus field(Side::kInside, kRingMm, 3);
  const WallModel wall{.stiffness_N_mm2 = 0.5};
  const std::vector<EnergyTerm*> none;
  const auto relaxation = MakeNewtonRelaxation(model, field, wall, {.tolerance = 1e-8}, none);
  WireState state(model);
  relaxation->Restart(state);
  Journey journey;
  const auto go = [&](const InstrumentPoses& target) {
    CountedBudget budget(20000);
    const double start_s = ThreadCpuSeconds();
    const TickReport report = relaxation->Tick(target, budget, state);
    journey.ms += 1e3 * (ThreadCpuSeconds() - start_s);
    journey.iterations += report.iterations;
    journey.unconverged += !report.converged;
  };
  for (int k = 1; k <= kFedMm; ++k) go({1.0 * k, 0});
  for (int k = 1; k <= 31; ++k) {
    go({kFedMm, 0.1 * k});
    journey.nodes_mm.push_back(state.nodes());
  }
  return journey;
}

struct Distance {
  double mean_mm = 0;
  double tip_mm = 0;
  double largest_mm = 0;
};

Distance Between(const Journey& a, const Journey& b) {
  Distance distance;
  for (std::size_t k = 0; k < a.nodes_mm.size(); ++k) {
    const std::vector<Vector3d>& x = a.nodes_mm[k];
    const std::vector<Vector3d>& y = b.nodes_mm[k];
    double sum = 0;
    for (std::size_t i = 0; i < x.size(); ++i) {
      const double apart = (x[i] - y[i]).norm();
      sum += apart;
      distance.largest_mm = std::max(distance.largest_mm, apart);
    }
    const auto count = static_cast<double>(a.nodes_mm.size());
    distance.mean_mm += sum / static_cast<double>(x.size()) / count;
    distance.tip_mm += (x.back() - y.back()).norm() / count;
  }
  return distance;
}

class TwistStudy final : public Study {
 public:
  std::string name() const override { return "twist"; }
  std::string title() const override { return "Error of a model without twist"; }
  std::string summary() const override {
    return "torsionally rigid wire, compared with stiff, soft and steel wires";
  }

  bool Run(StudyRun& run) override {
    run.Section("A bent tip turned in a bend of 30 mm");
    run.Say(
        "Mean distances of all nodes and of the tip over half a turn of the hand. The references "
        "are a steel wire (GJ/EI 0.77) and the stiffest wire (1000). The wire is 70 mm long and "
        "has a bent tip of 12 mm.");
    table_ = {.caption = "Distance between wires of different torsional rigidity",
              .header = {"tip 1/mm, GJ/EI", "from steel mm", "its tip mm", "from stiff mm",
                         "its tip mm", "largest mm", "time ms"},
              .rows = {}};
    bool converged = true;
    for (const double curvature : {0.02, 0.05, 0.12}) {
      if (!run.quick() || curvature == 0.05) converged = Compare(curvature, run) && converged;
    }
    run.Show(table_);
    return converged;
  }

 private:
  bool Compare(double curvature, StudyRun& run) {
    const Journey steel = Travel(kSteel, curvature);
    const Journey stiff = Travel(kStiffest, curvature);
    bool converged = true;
    for (const double ratio : {0.0, kSteel, 1.0, 10.0, 100.0}) {
      const Journey journey = Travel(ratio, curvature);
      converged = converged && journey.unconverged == 0;
      const Distance to_steel = Between(journey, steel);
      const Distance to_stiff = Between(journey, stiff);
      const std::string name =
          Number(curvature) + (ratio == 0 ? ", no twist" : ", " + Number(ratio));
      run.Record(name, "from_steel_mean", to_steel.mean_mm, "mm");
      run.Record(name, "from_steel_tip", to_steel.tip_mm, "mm");
      run.Record(name, "from_stiff_mean", to_stiff.mean_mm, "mm");
      run.Record(name, "from_stiff_tip", to_stiff.tip_mm, "mm");
      run.Record(name, "time", journey.ms, "ms");
      run.Record(name, "iterations", journey.iterations, "");
      table_.rows.push_back({name, Number(to_steel.mean_mm), Number(to_steel.tip_mm),
                             Number(to_stiff.mean_mm), Number(to_stiff.tip_mm),
                             Number(to_stiff.largest_mm), Number(journey.ms)});
    }
    return converged;
  }

  Table table_;
};

}  // namespace

std::unique_ptr<Study> MakeTwistStudy() { return std::make_unique<TwistStudy>(); }

}  // namespace torquer::study
