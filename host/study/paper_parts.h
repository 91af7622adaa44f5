// The parts of the paper study, and what they share.
#pragma once

#include <string>
#include <vector>

#include "host/simulator/vessel/phantoms.h"
#include "host/study/study.h"

namespace torquer::study {

/// Our figures beside the paper's.
class PaperComparison {
 public:
  explicit PaperComparison(StudyRun& run) : run_(run) {}

  /// Records `metric` of `case_name`, and the paper's own value as `metric`_paper, and adds a line
  /// to the table. `remark`: where a difference comes from.
  void Add(const std::string& what, const std::string& case_name, const std::string& metric,
           double paper, double ours, const std::string& unit, const std::string& remark);
  const Table& table() const { return table_; }

 private:
  StudyRun& run_;
  Table table_{"Ours beside the paper's (i7-4500U, 2013)",
               {"what", "paper", "ours", "unit", "paper / ours", "where the difference comes from"},
               {}};
};

/// What every part gets.
struct PaperPart {
  StudyRun& run;
  const vessel::TubeVessel& phantom;
  PaperComparison& comparison;
};

/// The three resolutions of the paper.
inline constexpr double kPaperSegmentsMm[] = {2.5, 1.0, 0.4};

/// Fast insertion, Table 1, (20), (32), (33), Figs. 12 to 14, the predecessor's insertion.
void MeasurePaperTimes(PaperPart& part);
/// Fig. 15: what Geometrical Relaxation saves.
void MeasurePaperSavings(PaperPart& part);
/// Figs. 16 and 17, section 4.5: contacts, updates, bending laws, angles.
void MeasurePaperShapes(PaperPart& part);

/// Coefficients c of sum c_k n^(powers_k) that fit t with the least sum of squared relative errors.
std::vector<double> FitPowers(const std::vector<double>& n, const std::vector<double>& t,
                              const std::vector<int>& powers);

/// "n = 250" from a segment length.
std::string CaseOf(double segment_mm);

}  // namespace torquer::study
