// Accuracy grid: the settings that the accuracy study measures.
#pragma once

#include <string>
#include <vector>

#include "host/study/accuracy_bench.h"

namespace torquer::study {

/// Ordered settings that differ in one parameter.
struct AccuracyAxis {
  std::string title;
  std::string x_label;  ///< label of the x axis
  bool logarithmic = false;
  std::vector<double> x;  ///< one value per case; empty if the cases have names only
  std::vector<AccuracyCase> cases;
};

/// Default settings of the simulator.
AccuracyCase DefaultCase();

/// Combinations of segment length and method for the Pareto front. The default is the first.
std::vector<AccuracyCase> FrontCases(bool quick);

/// One axis at a time around the default: friction, bending law, contact points and field. The
/// update rule varies around the paper's method.
std::vector<AccuracyAxis> AxisCases(bool quick);

}  // namespace torquer::study
