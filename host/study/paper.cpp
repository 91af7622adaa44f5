#include "host/study/paper.h"

#include <cmath>

#include "host/simulator/core/bending.h"

namespace torquer::study {
namespace {

// Fig. 17: the bending laws against the exact one.
void CompareBendingLaws(StudyRun& run) {
  Plot plot;
  plot.title = "Bending energy of a joint (Fig. 17)";
  plot.x.label = "angle, rad";
  plot.y.label = "g";
  for (const auto& [law, label] :
       {std::pair{BendingLaw::kExact, "exact"}, {BendingLaw::kG1, "g1"}, {BendingLaw::kG2, "g2"}}) {
    Series series{label, law == BendingLaw::kExact ? Mark::kLine : Mark::kDashed, {}, {}};
    for (int k = 0; k <= 100; ++k) {
      const double theta = M_PI / 2 * k / 100;
      series.x.push_back(theta);
      series.y.push_back(EvaluateBending(law, 1 - std::cos(theta)).g);
    }
    plot.series.push_back(series);
  }
  run.Section("Bending energies");
  run.Draw(plot, "Up to 0.1 rad the three agree; past 1 rad only g1 still follows the exact law.");
  const double y = 2 * std::pow(std::sin(0.05), 2);
  const double exact = EvaluateBending(BendingLaw::kExact, y).g;
  run.Record("bending/theta=0.1", "g1_error",
             100 * std::abs(EvaluateBending(BendingLaw::kG1, y).g / exact - 1), "%");
  run.Record("bending/theta=0.1", "g2_error",
             100 * std::abs(EvaluateBending(BendingLaw::kG2, y).g / exact - 1), "%");
}

class PaperStudy final : public Study {
 public:
  std::string name() const override { return "paper"; }
  std::string title() const override { return "Baier et al. (2016), measured again"; }
  std::string summary() const override {
    return "the paper's method: its tables and figures beside ours";
  }
  bool Run(StudyRun& run) override {
    CompareBendingLaws(run);
    return true;
  }
};

}  // namespace

std::unique_ptr<Study> MakePaperStudy() { return std::make_unique<PaperStudy>(); }

}  // namespace torquer::study
