// Picture of the paper on the cylinder, 36 x 36 pixels, as the sensor's camera takes it. It depends
// on the place and on errors of the assembly. The optics follow the PMW3360's data sheet 1.50 and
// pictures of a real sensor (README.md).
#pragma once

#include <array>
#include <cstdint>

namespace torquer::emulator {

/// Distance from lens reference plane to surface with nominal resolution and a sharp picture, mm.
inline constexpr double kNominalDistance_mm = 2.4;

/// Position of the sensor above the surface, its light and its dirt.
struct SurfaceOptics {
  /// Lens reference plane to surface, mm; sharp at kNominalDistance_mm.
  double distance_mm = kNominalDistance_mm;
  /// Relative change of the image size, and of the counts of a motion, per mm of greater distance;
  /// negative. Figure 12 of the data sheet: -0.028 to -0.13, depending on the surface.
  double magnification_per_mm = -0.08;
  /// Fraction of the picture that dust or glue on lens or window covers, 0 .. 1.
  double dirt = 0;
  /// Brightness at the end of the view toward the sensor's +y over that at the other, > 0. The
  /// sensor's own lamp shines along y; on flat targets the ratio is 1.2 to 1.5.
  double lamp_shading = 1.35;
  /// The same along the sensor's x, around the cylinder: light from the side.
  double side_shading = 1;
};

/// Size of the surface's image, and counts for its motion, over those at kNominalDistance_mm.
double Magnification(const SurfaceOptics& optics, double distance_mm);

inline constexpr int kPictureSide = 36;
using SurfacePicture = std::array<std::uint8_t, kPictureSide * kPictureSide>;  ///< 0 .. 127

/// Picture at a place on the surface (mm, along the sensor's axes). Its pixels are in the sensor's
/// order (data sheet, figure 24). Columns follow by rising x; y rises within a column. The same
/// place gives the same picture; `seed` selects the paper.
SurfacePicture RenderSurface(double x_mm, double y_mm, const SurfaceOptics& optics,
                             std::uint32_t seed);

/// SQUAL of such a picture, 0 .. 128: 64 on good paper in focus.
std::uint8_t SurfaceQuality(const SurfaceOptics& optics);

}  // namespace torquer::emulator
