// The result of a calibration in words, as a chart for the terminal, and as a picture. No I/O.
#pragma once

#include <string>

#include "calibration/procedure.h"

namespace torquer::tools {

enum class Grade { kGood, kUsable, kPoor };

/// By the error of a push of 150 mm and of a whole turn: good up to 2 mm and 3 degrees, usable up
/// to 6 mm and 10 degrees.
Grade GradeOf(const calibration::MotionFit& fit);

/// Parameters with standard errors and 95 % intervals, as a table.
std::string ParameterTable(const calibration::ProcedureResult& result);

/// Residuals stroke by stroke, `columns` wide (>= 60).
std::string ResidualChart(const calibration::ProcedureResult& result, int columns);

/// In plain words: by how much 150 mm and a turn may be off, how good that is, and what would
/// improve it. `length_mm` is that of a push, by stops or by a ruler.
std::string Verdict(const calibration::ProcedureResult& result,
                    const calibration::ProcedureSettings& settings);

/// Residuals of pushes and turns as one <svg> element; `heading` is its first line.
std::string ResidualPicture(const calibration::ProcedureResult& result, const std::string& heading);

}  // namespace torquer::tools
