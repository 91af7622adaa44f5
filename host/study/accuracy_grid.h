// The settings that the study of accuracy measures.
#pragma once

#include <string>
#include <vector>

#include "host/study/accuracy_bench.h"

namespace torquer::study {

/// Settings that differ in one thing, in order.
struct AccuracyAxis {
  std::string title;
  std::string x_label;  ///< of its picture
  bool logarithmic = false;
  std::vector<double> x;  ///< one a case; empty where the cases are names
  std::vector<AccuracyCase> cases;
};

/// What the simulator does unless a scene says otherwise.
AccuracyCase DefaultCase();

/// Segment length x method: what the Pareto front is made of. The default is the first.
std::vector<AccuracyCase> FrontCases(bool quick);

/// One axis at a time around the default: friction, bending law, contact points, field; and the
/// update rule around the paper's method.
std::vector<AccuracyAxis> AxisCases(bool quick);

}  // namespace torquer::study
