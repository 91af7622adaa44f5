// Picture that the sensor's camera takes of the paper on the cylinder: 36 x 36 pixels, made from
// where it looks and from what an assembly can get wrong. The optics follow the PMW3360's data
// sheet 1.50 and pictures of a real one (README.md).
#pragma once

#include <array>
#include <cstdint>

namespace torquer::emulator {

/// Lens reference plane to surface at which the resolution is nominal and the picture sharp, mm.
inline constexpr double kNominalDistance_mm = 2.4;

/// Position of the sensor above the surface, its light and its dirt.
struct SurfaceOptics {
  /// Lens reference plane to surface, mm; sharp at kNominalDistance_mm.
  double distance_mm = kNominalDistance_mm;
  /// Share by which the surface looks larger, and moves by more counts, for each millimeter that it
  /// is farther away; negative. Figure 12 of the data sheet: -0.028 to -0.13, by surface.
  double magnification_per_mm = -0.08;
  /// Share of the picture that dust or glue on lens or window covers, 0 .. 1.
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

/// The picture at a place on the surface (mm, along the sensor's axes), in the order in which the
/// sensor sends it (data sheet, figure 24): column by column, y rising within a column, then x. The
/// same place gives the same picture; `seed` is that of the paper.
SurfacePicture RenderSurface(double x_mm, double y_mm, const SurfaceOptics& optics,
                             std::uint32_t seed);

/// SQUAL of such a picture, 0 .. 128: 64 on good paper in focus.
std::uint8_t SurfaceQuality(const SurfaceOptics& optics);

}  // namespace torquer::emulator
