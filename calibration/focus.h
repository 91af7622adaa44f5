// Focus check: judges a sensor's assembly by its raw pictures. It finds dirt, light that falls from
// the side, and, from pictures at several heights, the focus. No I/O.
//
// A picture is 36 x 36 pixels, 0 to 127, of about a millimeter of paper. What is in it: the light's
// slope (a plane through all pixels), the fibers of the paper (fine, and another picture at another
// place), and dirt on lens or window (dark, coarse, and at the same place in every picture).
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

/// kFocusPixels of them as the sensor sends them (PMW3360 data sheet, figure 24): line by line
/// around the cylinder (x of the sensor), and within a line along the pipe (y).
using FocusPicture = std::vector<std::uint8_t>;

/// Figures measured in pictures of one surface. Several pictures should show different places.
struct FocusFigures {
  double brightness = 0;  ///< mean, 0 .. 1 of white
  /// Brightest over darkest edge of the view across the pipe, by the plane; >= 1.
  double shading_across = 1;
  /// The same along the pipe. The sensor's own lamp gives 1.2 to 1.5 there, so it is not judged.
  double shading_along = 1;
  double contrast = 0;  ///< standard deviation about the plane over the mean
  /// Difference of neighboring pixels over that of distant ones, as variances: near 0 for a blurred
  /// picture, 1 for one as fine as its pixels. 0 where there is no contrast. It depends on the
  /// surface as much as on the focus: compare it at several heights over one surface.
  double sharpness = 0;
  /// Share of the view that is dark in all pictures alike, 0 .. 1.
  double dirt = 0;
  double saturated = 0;  ///< share of pixels that are black or white
};

/// Throws UserError if there is no picture, or one has not kFocusPixels pixels of 0 .. 127.
FocusFigures MeasureFocus(std::span<const FocusPicture> pictures);

/// Result of the focus check for the builder of a device.
struct FocusVerdict {
  FocusFigures figures;
  bool good = false;
  /// Problems and their remedies, one sentence each, most important first; a single sentence saying
  /// so if there is no problem.
  std::vector<std::string> findings;
};

/// `surface_quality` is the sensor's own, SQUAL, as in its reports.
FocusVerdict JudgeFocus(std::span<const FocusPicture> pictures, int surface_quality);

/// Sharpness of a surface at one height of the sensor.
struct FocusHeight {
  double shims_mm = 0;   ///< height of the shims below the carrier, >= 0
  double sharpness = 0;  ///< FocusFigures::sharpness, >= 0
};

/// Height at which the surface is sharpest.
struct FocusSearch {
  /// Vertex of the parabola through the sharpest height and its two neighbors; nothing until
  /// pictures were taken on both sides of the maximum.
  std::optional<double> best_shims_mm;
  bool in_focus = false;  ///< the last height is within kFocusTolerance_mm of it
  std::string advice;     ///< one sentence: the next height, or the result
};

/// Half a step of the height: shims, and sheets of paper of 0.1 mm.
inline constexpr double kFocusTolerance_mm = 0.05;

/// Finds the focus as the maximum of sharpness over the heights, in the order in which they were
/// taken; the last one is the current. Of several values for one height the last counts. Throws
/// UserError if there is none, or one is not finite or negative.
FocusSearch FindFocus(std::span<const FocusHeight> heights);

}  // namespace torquer::calibration
