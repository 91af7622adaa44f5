// What a calibration found, in words, in a chart for the terminal and as a picture. No I/O.
#pragma once

#include <string>

#include "calibration/procedure.h"

namespace torquer::tools {

enum class Grade { kGood, kUsable, kPoor };

/// By what a push of 150 mm and a whole turn may be off: good up to 2 mm and 3 degrees, usable up
/// to 6 mm and 10 degrees.
Grade GradeOf(const calibration::MotionFit& fit);

/// Parameters with standard errors and 95 % intervals, as a table.
std::string ParameterTable(const calibration::ProcedureResult& result);

/// Residuals stroke by stroke, `columns` wide (>= 60).
std::string ResidualChart(const calibration::ProcedureResult& result, int columns);

/// In plain words: what 150 mm and a turn may be off by, how good that is, and what would mend it.
/// `length_mm` is that of a push, by stops or by a ruler.
std::string Verdict(const calibration::ProcedureResult& result,
                    const calibration::ProcedureSettings& settings);

/// Residuals of pushes and turns as one <svg> element; `heading` is its first line.
std::string ResidualPicture(const calibration::ProcedureResult& result, const std::string& heading);

}  // namespace torquer::tools
