// Attenuation of the X-rays: line integrals along the rays, one per pixel.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

namespace torquer::effects {

/// -ln(transmitted fraction) of each pixel, row by row.
struct Plane {
  int width = 0;
  int height = 0;
  std::vector<float> value;

  void Clear(int columns, int rows) {
    width = columns;
    height = rows;
    value.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0.0F);
  }
  float& At(int column, int row) {
    return value[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(column)];
  }
};

/// Point of a wire.
struct WirePoint {
  Eigen::Vector3d position_mm;
  double radius_mm = 0;
  double attenuation_1_mm = 0;
};

/// Adds a wire, round and solid, along a polyline. A wire thinner than a pixel covers only its
/// share of it. The chord is averaged over the pixel's width, and lengths share the pixels at their
/// ends.
void AddWire(const Projection& projection, const std::vector<WirePoint>& wire, Plane& plane);

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
  // Depth range in which the rays of a pixel run in dye: the fraction of rays that do, and the mean
  // length over all rays.
  struct Stretch {
    float near_mm, far_mm, attenuation_1_mm, part, length_mm;
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

/// Patient around the vessels: a smooth body with a spine.
struct Body {
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  vessel::PatientAxes axes;
  double width_mm = 320;  ///< from left to right; 0: no body
  double depth_mm = 220;  ///< from front to back
  double tissue_1_mm = 0.018;
  double spine_1_mm = 0.01;  ///< in excess of tissue
  /// Displacement of the organs by breath and heartbeat.
  Eigen::Vector3d organs_mm = Eigen::Vector3d::Zero();
};

/// Line integral through the body along the middle ray.
double MiddleIntegral(const Projection& projection, const Body& body);

/// Adds the line integrals through the body to the plane. They are smooth, so they are evaluated on
/// a grid and interpolated. Returns the mean in the field's middle, which sets the exposure.
float FillWithBody(const Projection& projection, const Body& body, Plane& plane);

/// Blurs by 1/4 1/2 1/4 in rows and columns, as focal spot and detector do. `scratch` may have any
/// size.
void Blur(Plane& plane, Plane& scratch);

}  // namespace torquer::effects
