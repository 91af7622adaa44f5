// Focus picture: the sensor's camera picture and its verdict, as text and as PNG. No I/O.
#pragma once

#include <string>

#include "calibration/focus.h"

namespace torquer::tools {

/// Formats the picture with kFocusSide columns; each line shows two rows of pixels. With `gray`
/// these are half blocks in shades of gray (escape sequences of a terminal with 256 colors).
/// Otherwise each is one of ten characters, dark to bright. Lines end with \n.
std::string FocusText(const calibration::FocusPicture& picture, bool gray);

/// Encodes a PNG with 10 x 10 points for each pixel.
std::string FocusPng(const calibration::FocusPicture& picture);

/// Formats the figures in one line, and each finding in a further line; `surface_quality` is SQUAL.
/// Lines end with \n.
std::string FocusVerdictText(const calibration::FocusVerdict& verdict, int surface_quality);

}  // namespace torquer::tools
