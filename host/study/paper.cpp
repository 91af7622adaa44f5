#include "host/study/paper.h"

#include <Eigen/Dense>
#include <cassert>
#include <cmath>

#include "host/study/paper_bench.h"
#include "host/study/paper_parts.h"

namespace torquer::study {

void PaperComparison::Add(const std::string& what, const std::string& case_name,
                          const std::string& metric, double paper, double ours,
                          const std::string& unit, const std::string& remark) {
  run_.Record(case_name, metric, ours, unit);
  run_.Record(case_name, metric + "_paper", paper, unit);
  table_.rows.push_back(
      {what, Number(paper, 4), Number(ours, 3), unit, Number(paper / ours, 3), remark});
}

std::vector<double> FitPowers(const std::vector<double>& n, const std::vector<double>& t,
                              const std::vector<int>& powers) {
  assert(n.size() == t.size() && n.size() >= powers.size());
  const auto rows = static_cast<Eigen::Index>(n.size());
  const auto columns = static_cast<Eigen::Index>(powers.size());
  Eigen::MatrixXd a(rows, columns);
  for (Eigen::Index r = 0; r < rows; ++r) {
    const auto k = static_cast<std::size_t>(r);
    for (Eigen::Index c = 0; c < columns; ++c) {
      a(r, c) = std::pow(n[k], powers[static_cast<std::size_t>(c)]) / t[k];
    }
  }
  const Eigen::VectorXd fit = a.colPivHouseholderQr().solve(Eigen::VectorXd::Ones(rows));
  return {fit.data(), fit.data() + fit.size()};
}

std::string CaseOf(double segment_mm) {
  return "n=" + std::to_string(std::lround(PaperBench::kLengthMm / segment_mm));
}

namespace {

class PaperStudy final : public Study {
 public:
  std::string name() const override { return "paper"; }
  std::string title() const override { return "Repeated measurements of Baier et al. (2016)"; }
  std::string summary() const override {
    return "tables and figures of the paper, compared with the simulator's results";
  }
  bool Run(StudyRun& run) override {
    const vessel::TubeVessel phantom = vessel::MakeTyPhantom();
    PaperComparison comparison(run);
    PaperPart part{run, phantom, comparison};
    run.Say(
        "The method of Baier et al., \"Simulator for Minimally Invasive Vascular Interventions\", "
        "Presence 25(2), 2016, is coded equation by equation. The measurements follow its section "
        "4. The wire is the paper's: 250 mm, EI = 6.35e-9 N m^2. The artery of Fig. 12 is "
        "published as a picture only. Our artery has the same parts, a T and then a Y. Its lumen "
        "is 8 mm wide, and its wall has 0.01 N/mm per node at lambda = 1 mm. The wire has a "
        "diameter of 0.356 mm. Times, ratios, exponents and sizes of errors can thus be compared, "
        "but coordinates cannot.");
    if (run.quick()) {
      run.Say("Quick run: fewer cycles at n = 625, their times scaled to 100 cycles.");
    }
    MeasurePaperTimes(part);
    MeasurePaperSavings(part);
    MeasurePaperShapes(part);
    run.ShowFirst(comparison.table());
    return true;
  }
};

}  // namespace

std::unique_ptr<Study> MakePaperStudy() { return std::make_unique<PaperStudy>(); }

}  // namespace torquer::study
