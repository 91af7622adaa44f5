// The picture of the sensor's camera and what it says, as text and as PNG. No I/O.
#pragma once

#include <string>

#include "calibration/focus.h"

namespace torquer::tools {

/// kFocusSide columns; each line shows two rows of pixels, as half blocks in shades of gray
/// (`gray`: escape sequences of a terminal with 256 colors) or as one of ten characters, dark to
/// bright. Lines end with \n.
std::string FocusText(const calibration::FocusPicture& picture, bool gray);

/// A PNG of 10 x 10 points a pixel.
std::string FocusPng(const calibration::FocusPicture& picture);

/// The figures in one line, and each finding in one more; `surface_quality` is SQUAL. Lines end
/// with \n.
std::string FocusVerdictText(const calibration::FocusVerdict& verdict, int surface_quality);

}  // namespace torquer::tools
