// Tables and pictures of the study of accuracy.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "host/study/accuracy_bench.h"
#include "host/study/accuracy_grid.h"
#include "host/study/study.h"

namespace torquer::study {

struct Measured {
  AccuracyCase setting;
  AccuracyOutcome outcome;
};
using MeasuredCases = std::map<std::string, Measured>;  // by the case's name

/// A setting's place in the picture of error against time.
struct FrontPoint {
  std::string name;
  std::string group;
  double ms_per_mm;
  double error_mm;
};

/// The points that no other one beats in both time and error, fastest first.
std::vector<FrontPoint> ParetoFront(std::vector<FrontPoint> points);

struct AccuracyResults {
  const std::vector<AccuracyAxis>& axes;
  const std::map<std::string, MeasuredCases>& measured;             ///< by scene
  const std::map<std::string, std::vector<std::string>>& left_out;  ///< scenes, by case
};

/// Everything of the report; also records what one more digit costs.
void ReportAccuracy(StudyRun& run, const AccuracyResults& results);

}  // namespace torquer::study
