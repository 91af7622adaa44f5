// Report of the accuracy study: tables and pictures.
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
using MeasuredCases = std::map<std::string, Measured>;  // key: name of the case

/// Point of a setting in the plot of error against time.
struct FrontPoint {
  std::string name;
  std::string group;
  double ms_per_mm;
  double error_mm;
};

/// Pareto front: points that no other point beats in both time and error, fastest first.
std::vector<FrontPoint> ParetoFront(std::vector<FrontPoint> points);

struct AccuracyResults {
  const std::vector<AccuracyAxis>& axes;
  const std::map<std::string, MeasuredCases>& measured;             ///< key: scene
  const std::map<std::string, std::vector<std::string>>& left_out;  ///< scenes; key: case
};

/// Writes the whole report; also records the cost of one more digit of accuracy.
void ReportAccuracy(StudyRun& run, const AccuracyResults& results);

}  // namespace torquer::study
