// Picture that the sensor's camera takes of the paper on the cylinder: 36 x 36 pixels, made from
// where it looks and from what an assembly can get wrong.
#pragma once

#include <array>
#include <cstdint>

namespace torquer::emulator {

/// Position of the sensor above the surface, and its dirt.
struct SurfaceOptics {
  /// Lens reference plane to surface, mm; sharp at 2.4.
  double distance_mm = 2.4;
  /// Share of the picture that dust or glue on lens or window covers, 0 .. 1.
  double dirt = 0;
  /// Brightness of one edge of the view over that of the other, >= 1.
  double shading = 1;
  /// Direction in which the picture gets darker: along the sensor's y axis, else along its x.
  bool shading_along_y = false;
};

inline constexpr int kPictureSide = 36;
using SurfacePicture = std::array<std::uint8_t, kPictureSide * kPictureSide>;  ///< 0 .. 127

/// The picture at a place on the surface (mm, along the sensor's axes), row by row along y. The
/// same place gives the same picture; `seed` is that of the paper.
SurfacePicture RenderSurface(double x_mm, double y_mm, const SurfaceOptics& optics,
                             std::uint32_t seed);

/// SQUAL of such a picture, 0 .. 128: 64 on good paper in focus.
std::uint8_t SurfaceQuality(const SurfaceOptics& optics);

}  // namespace torquer::emulator
