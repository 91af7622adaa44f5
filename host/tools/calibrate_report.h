// Calibration report: the result in words, as a chart for the terminal, and as a picture. No I/O.
#pragma once

#include <string>

#include "calibration/procedure.h"

namespace torquer::tools {

enum class Grade { kGood, kUsable, kPoor };

/// Grades the error of a push of 150 mm and of a whole turn. The fit is good up to 2 mm and 3
/// degrees, usable up to 6 mm and 10 degrees.
Grade GradeOf(const calibration::MotionFit& fit);

/// Parameters with standard errors and 95 % intervals, as a table.
std::string ParameterTable(const calibration::ProcedureResult& result);

/// Residuals stroke by stroke, `columns` wide (>= 60).
std::string ResidualChart(const calibration::ProcedureResult& result, int columns);

/// States in plain words the possible errors of 150 mm and of a turn, their grade, and
/// improvements. `length_mm` is the length of a push, from stops or a ruler.
std::string Verdict(const calibration::ProcedureResult& result,
                    const calibration::ProcedureSettings& settings);

/// Plots residuals of pushes and turns as one <svg> element; `heading` is its first line.
std::string ResidualPicture(const calibration::ProcedureResult& result, const std::string& heading);

}  // namespace torquer::tools
