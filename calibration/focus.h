// Focus check: judges a sensor's assembly by its raw pictures. It finds dirt, light that falls from
// the side, and, from pictures at several heights, the focus. No I/O.
//
// A picture is 36 x 36 pixels, 0 to 127, of about a millimeter of paper. It contains three things.
// The slope of the light is a plane through all pixels. The fibers of the paper are fine, and
// differ from place to place. Dirt on lens or window is dark, coarse, and at the same place in
// every picture.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace torquer::calibration {

inline constexpr int kFocusSide = 36;
inline constexpr int kFocusPixels = kFocusSide * kFocusSide;
inline constexpr std::uint8_t kFocusWhite = 127;

/// kFocusPixels pixels in the sensor's order (PMW3360 data sheet, figure 24). Lines follow each
/// other around the cylinder (x of the sensor). Within a line, pixels follow the pipe (y).
using FocusPicture = std::vector<std::uint8_t>;

/// Figures measured in pictures of one surface. Several pictures should show different places.
struct FocusFigures {
  double brightness = 0;  ///< mean, 0 .. 1 of white
  /// Ratio of the brightest to the darkest edge of the view across the pipe, from the plane; >= 1.
  double shading_across = 1;
  /// The same along the pipe. The sensor's own lamp gives 1.2 to 1.5 there, so it is not judged.
  double shading_along = 1;
  double contrast = 0;  ///< standard deviation about the plane over the mean
  /// Variance of the difference of neighboring pixels over the variance of the difference of
  /// distant pixels. It is near 0 for a blurred picture, 1 for details as fine as a pixel, and 0
  /// without contrast. It depends on the surface as much as on the focus: compare it at several
  /// heights over one surface.
  double sharpness = 0;
  /// Fraction of the view that is dark in all pictures, 0 .. 1.
  double dirt = 0;
  double saturated = 0;  ///< share of pixels that are black or white
};

/// Throws UserError without pictures, or if a picture does not have kFocusPixels pixels of 0 ..
/// 127.
FocusFigures MeasureFocus(std::span<const FocusPicture> pictures);

/// Result of the focus check for the builder of a device.
struct FocusVerdict {
  FocusFigures figures;
  bool good = false;
  /// Problems and their remedies, one sentence each, the most important first. Without a problem,
  /// one sentence that reports this.
  std::vector<std::string> findings;
};

/// `surface_quality`: SQUAL, as in the sensor's reports.
FocusVerdict JudgeFocus(std::span<const FocusPicture> pictures, int surface_quality);

/// Sharpness of a surface at one height of the sensor.
struct FocusHeight {
  double shims_mm = 0;   ///< height of the shims below the carrier, >= 0
  double sharpness = 0;  ///< FocusFigures::sharpness, >= 0
};

/// Height at which the surface is sharpest.
struct FocusSearch {
  /// Vertex of the parabola through the sharpest height and its two neighbors. Empty until pictures
  /// were taken on both sides of the maximum.
  std::optional<double> best_shims_mm;
  bool in_focus = false;  ///< the last height is within kFocusTolerance_mm of it
  std::string advice;     ///< one sentence: the next height, or the result
};

/// Half a step of the height, which shims and sheets of paper of 0.1 mm adjust.
inline constexpr double kFocusTolerance_mm = 0.05;

/// Finds the focus: the height of maximum sharpness. The heights are in the order of the pictures;
/// the last is the present one. If a height occurs several times, its last value counts. Throws
/// UserError without heights, or if a value is not finite or is negative.
FocusSearch FindFocus(std::span<const FocusHeight> heights);

}  // namespace torquer::calibration
