// Attenuation of the X-rays: line integrals along the rays, one per pixel.
#pragma once

#include <Eigen/Core>
#include <cstddef>
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

/// Values at every `step`-th row and column of a plane, up to its edges or beyond them.
struct PlaneGrid {
  PlaneGrid(const Plane& plane, int every)
      : step(every),
        columns((plane.width + every - 1) / every + 1),
        rows((plane.height + every - 1) / every + 1),
        value(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows)) {}

  float& At(int column, int row) { return value[IndexOf(column, row)]; }
  /// True in the field's middle, where the exposure is measured: it is the position of the patient.
  bool IsMiddle(int column, int row) const {
    return row >= rows / 4 && row <= rows * 3 / 4 && column >= columns / 4 &&
           column <= columns * 3 / 4;
  }
  /// Adds the values, interpolated, to the plane.
  void AddTo(Plane& plane) const;

  int step;
  int columns;
  int rows;
  std::vector<float> value;

 private:
  std::size_t IndexOf(int column, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
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

/// Blurs by 1/4 1/2 1/4 in rows and columns, as focal spot and detector do. `scratch` may have any
/// size.
void Blur(Plane& plane, Plane& scratch);

}  // namespace torquer::effects
