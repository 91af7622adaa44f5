// What the rays lose on their way: line integrals of attenuation, one for each pixel.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

namespace torquer::effects {

/// -ln(transmitted part), for each pixel, row by row.
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

/// A place on a wire.
struct WirePoint {
  Eigen::Vector3d position_mm;
  double radius_mm = 0;
  double attenuation_1_mm = 0;
};

/// Adds a wire, round and solid, along a polyline. Thinner than a pixel, it takes its share of
/// each: the chord is averaged over the pixel's width, and lengths share the pixels at their ends.
void AddWire(const Projection& projection, const std::vector<WirePoint>& wire, Plane& plane);

/// A place on a vessel's axis.
struct LumenPoint {
  Eigen::Vector3d position_mm;
  Eigen::Vector3d tangent;  ///< unit; the plane across it is where two stretches meet
  double radius_mm = 0;
  float attenuation_1_mm = 0;  ///< of what fills the lumen there
};

/// Lumens filled with dye: cones between the points. Where lumens overlap, as at ostia, the union
/// counts once, with the mean of what fills them. Of a lumen a few pixels wide or less a pixel gets
/// the mean over its area, by several rays.
class LumenPainter {
 public:
  /// Forgets all; the next picture has this size.
  void Begin(int width, int height);
  /// A stretch of vessel; what is clear is left out.
  void Add(const Projection& projection, const LumenPoint* points, std::size_t count);
  /// Adds the line integrals.
  void AddTo(const Projection& projection, Plane& plane);

 private:
  // Depths between which the rays of a pixel run in dye: the part of them that does, and the mean
  // length of all.
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
  // The vessel in hand: one stretch a pixel, whose cones follow each other and never overlap.
  std::vector<Stretch> own_;
  std::vector<std::uint8_t> has_own_;
  std::vector<std::size_t> own_pixels_;
  std::vector<float> beyond_;  // integrals (per depth) of more stretches than a pixel has room for
  int first_row_ = 0, last_row_ = -1;
};

/// The patient around the vessels: a smooth body with a spine.
struct Body {
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  vessel::PatientAxes axes;
  double width_mm = 320;  ///< from left to right; 0: no body
  double depth_mm = 220;  ///< from front to back
  double tissue_1_mm = 0.018;
  double spine_1_mm = 0.01;  ///< more than tissue
  /// How far breath and heart have moved the organs.
  Eigen::Vector3d organs_mm = Eigen::Vector3d::Zero();
};

/// The line integral through the body along the middle ray.
double MiddleIntegral(const Projection& projection, const Body& body);

/// Adds the line integrals through the body to the plane. They are smooth, so they are found on a
/// grid and interpolated. Returns the mean of the field's middle, to which an exposure is set.
float FillWithBody(const Projection& projection, const Body& body, Plane& plane);

/// Blurs by 1/4 1/2 1/4 in rows and columns, `scratch` of any size: focal spot and detector.
void Blur(Plane& plane, Plane& scratch);

}  // namespace torquer::effects
