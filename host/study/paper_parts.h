// Parts of the paper study, and their shared declarations.
#pragma once

#include <string>
#include <vector>

#include "host/simulator/vessel/phantoms.h"
#include "host/study/study.h"

namespace torquer::study {

/// Table of our figures beside the paper's.
class PaperComparison {
 public:
  explicit PaperComparison(StudyRun& run) : run_(run) {}

  /// Records `metric` of `case_name`, and the paper's own value as `metric`_paper, and adds a line
  /// to the table. `remark`: cause of a difference.
  void Add(const std::string& what, const std::string& case_name, const std::string& metric,
           double paper, double ours, const std::string& unit, const std::string& remark);
  const Table& table() const { return table_; }

 private:
  StudyRun& run_;
  Table table_{"Our values and the paper's (i7-4500U, 2013)",
               {"quantity", "paper", "ours", "unit", "paper / ours", "reason for the difference"},
               {}};
};

/// Arguments of every part.
struct PaperPart {
  StudyRun& run;
  const vessel::TubeVessel& phantom;
  PaperComparison& comparison;
};

/// Segment lengths of the paper's three resolutions.
inline constexpr double kPaperSegmentsMm[] = {2.5, 1.0, 0.4};

/// Fast insertion, Table 1, (20), (32), (33), Figs. 12 to 14, the predecessor's insertion.
void MeasurePaperTimes(PaperPart& part);
/// Fig. 15: time saved by Geometrical Relaxation.
void MeasurePaperSavings(PaperPart& part);
/// Figs. 16 and 17, section 4.5: contacts, updates, bending laws, angles.
void MeasurePaperShapes(PaperPart& part);

/// Fits t by sum c_k n^(powers_k); returns the coefficients c with the least sum of squared
/// relative errors.
std::vector<double> FitPowers(const std::vector<double>& n, const std::vector<double>& t,
                              const std::vector<int>& powers);

/// Name of the case of a segment length, such as "n = 250".
std::string CaseOf(double segment_mm);

}  // namespace torquer::study
