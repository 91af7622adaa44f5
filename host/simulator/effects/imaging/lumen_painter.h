// Attenuation of vessels filled with dye.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

namespace torquer::effects {

/// Point of a vessel's axis.
struct LumenPoint {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d tangent;  ///< unit; two stretches meet in the plane across it
  double radius_mm = 0;
  float attenuation_1_mm = 0;  ///< of the contents of the lumen there
};

/// Painter of lumens filled with dye: cones between the points. Overlapping lumens, as at ostia,
/// count once as their union, with the mean of their attenuations. A pixel of a lumen at most a few
/// pixels wide gets the mean over its area, by several rays.
class LumenPainter {
 public:
  /// Clears everything; the next picture has this size.
  void Begin(int width, int height);
  /// Adds a stretch of vessel; parts without dye are skipped.
  void Add(const Projection& projection, const LumenPoint* points, std::size_t count);
  /// Adds the line integrals.
  void AddTo(const Projection& projection, Plane& plane);

 private:
  // Depth range in which the rays of a pixel run in dye. It has the fraction of such rays, and the
  // mean length over all rays.
  struct Stretch {
    float near_mm, far_mm, attenuation_1_mm, fraction, length_mm;
  };
  static constexpr int kStretches = 4;
  struct Pixel {
    Stretch stretch[kStretches];
  };
  struct Cone;

  void Paint(const Projection& projection, const Cone& cone);
  static bool Meet(const Cone& cone, const Projection& projection, double column, double row,
                   Stretch& stretch);
  void Collect(std::size_t pixel, const Stretch& stretch, float apart_mm);
  void Insert(std::size_t pixel, Stretch stretch);

  int width_ = 0;
  int height_ = 0;
  std::vector<Pixel> pixels_;
  std::vector<std::uint8_t> counts_;
  // Vessel being painted: one stretch per pixel; its cones follow each other and never overlap.
  std::vector<Stretch> own_;
  std::vector<std::uint8_t> has_own_;
  std::vector<std::size_t> own_pixels_;
  std::vector<float> beyond_;  // integrals (per depth) of stretches in excess of kStretches
  int first_row_ = 0, last_row_ = -1;
};

}  // namespace torquer::effects
