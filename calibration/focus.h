// Focus check: judges a sensor's assembly by its raw pictures. It finds a wrong height over the
// cylinder, dirt, and light that falls from one side. No I/O.
//
// A picture is 36 x 36 pixels, 0 to 127, of about a millimeter of paper. What is in it: the light's
// slope (a plane through all pixels), the fibers of the paper (fine, and another picture at another
// place), and dirt on lens or window (dark, coarse, and at the same place in every picture).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace torquer::calibration {

inline constexpr int kFocusSide = 36;
inline constexpr int kFocusPixels = kFocusSide * kFocusSide;
inline constexpr std::uint8_t kFocusWhite = 127;

/// Row by row, kFocusPixels of them.
using FocusPicture = std::vector<std::uint8_t>;

/// Figures measured in pictures of one surface. Several pictures should show different places.
struct FocusFigures {
  double brightness = 0;  ///< mean, 0 .. 1 of white
  /// Brightest over darkest edge of the view, by the plane; >= 1.
  double shading = 1;
  /// Toward the bright edge, from the direction in which rows grow rightward; rad, -pi .. pi.
  double shading_direction_rad = 0;
  double contrast = 0;  ///< standard deviation about the plane over the mean
  /// Difference of neighboring pixels over that of distant ones, as variances: near 0 for a blurred
  /// picture, 1 for one as fine as its pixels. 0 where there is no contrast.
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

}  // namespace torquer::calibration
