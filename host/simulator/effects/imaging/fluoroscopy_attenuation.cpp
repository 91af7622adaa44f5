#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/imaging/picture_band.h"

namespace torquer::effects {

using Eigen::Vector3d;

namespace {

// Integral of the chord 2 sqrt(r^2 - x^2) of a circle from its middle to x.
double ChordIntegral(double x, double r) {
  const double c = std::clamp(x, -r, r);
  return c * std::sqrt(std::max(0.0, r * r - c * c)) + r * r * std::asin(c / r);
}

void AddWirePiece(const Projection& projection, const WirePoint& a, const WirePoint& b,
                  Plane& plane) {
  const Vector3d pa = projection.ToCamera(a.position_mm);
  const Vector3d pb = projection.ToCamera(b.position_mm);
  if (pa[2] < kNearestMm || pb[2] < kNearestMm) return;
  const ImagePoint ia = projection.FromCamera(pa);
  const ImagePoint ib = projection.FromCamera(pb);
  const Vector3d middle = (pa + pb) / 2;
  const double depth_mm = middle[2];
  const double pixels_per_mm = projection.PixelsPerMm(depth_mm);
  double along_column = ib.column - ia.column;
  double along_row = ib.row - ia.row;
  const double length = std::hypot(along_column, along_row);
  const double radius_mm = (a.radius_mm + b.radius_mm) / 2;
  // A piece seen end-on is as deep as it is long. It is drawn slightly longer and keeps its mass.
  constexpr double kLeastPixels = 0.05;
  if (length < 1e-9) {
    along_column = 1;
    along_row = 0;
  } else {
    along_column /= length;
    along_row /= length;
  }
  const double drawn = std::max(length, kLeastPixels);
  // Length along the ray per mm across it, which preserves the mass of the piece.
  const double length_mm = (pb - pa).norm();
  const double slant = length_mm / (drawn / pixels_per_mm);
  const double ray =
      std::sqrt(1 + (middle[0] * middle[0] + middle[1] * middle[1]) / (depth_mm * depth_mm));
  const double attenuation = (a.attenuation_1_mm + b.attenuation_1_mm) / 2;
  constexpr double kHalf = 0.5;  // of a pixel
  const double half_mm = kHalf / pixels_per_mm;
  const double scale = attenuation * slant * ray / (2 * half_mm);
  const Band band{ia.column,
                  ia.row,
                  along_column,
                  along_row,
                  -kHalf,
                  drawn + kHalf,
                  radius_mm * pixels_per_mm + kHalf};
  int first_row = 0;
  int last_row = -1;
  band.Rows(plane.height, first_row, last_row);
  for (int row = first_row; row <= last_row; ++row) {
    int first = 0;
    int last = -1;
    if (!band.Columns(row, plane.width, first, last)) continue;
    for (int column = first; column <= last; ++column) {
      const double x = column - ia.column;
      const double y = row - ia.row;
      const double along = x * along_column + y * along_row;
      const double covered = std::min(along + kHalf, drawn) - std::max(along - kHalf, 0.0);
      if (covered <= 0) continue;
      const double across_mm = (y * along_column - x * along_row) / pixels_per_mm;
      const double chords = ChordIntegral(across_mm + half_mm, radius_mm) -
                            ChordIntegral(across_mm - half_mm, radius_mm);
      plane.At(column, row) += static_cast<float>(scale * covered * chords);
    }
  }
}

}  // namespace

void AddWire(const Projection& projection, const std::vector<WirePoint>& wire, Plane& plane) {
  for (std::size_t i = 1; i < wire.size(); ++i) {
    AddWirePiece(projection, wire[i - 1], wire[i], plane);
  }
}

void PlaneGrid::AddTo(Plane& plane) const {
  const float share = 1 / static_cast<float>(step);
  for (int row = 0; row < plane.height; ++row) {
    const float y = share * static_cast<float>(row % step);
    const float* const above = &value[IndexOf(0, row / step)];
    const float* const below = above + columns;
    float* out = &plane.At(0, row);
    for (int cell = 0; cell + 1 < columns; ++cell) {
      const float left = above[cell] + y * (below[cell] - above[cell]);
      const float right = above[cell + 1] + y * (below[cell + 1] - above[cell + 1]);
      const int inside = std::min(step, plane.width - cell * step);
      for (int n = 0; n < inside; ++n) {
        const float x = share * static_cast<float>(n);
        *out++ += left + x * (right - left);
      }
    }
  }
}

void Blur(Plane& plane, Plane& scratch) {
  const int w = plane.width;
  const int h = plane.height;
  scratch.width = w;
  scratch.height = h;
  scratch.value.resize(plane.value.size());
  for (int row = 0; row < h; ++row) {
    const float* const in = &plane.At(0, row);
    float* const out = &scratch.At(0, row);
    out[0] = 0.75F * in[0] + 0.25F * in[1];
    for (int c = 1; c + 1 < w; ++c) out[c] = 0.5F * in[c] + 0.25F * (in[c - 1] + in[c + 1]);
    out[w - 1] = 0.75F * in[w - 1] + 0.25F * in[w - 2];
  }
  for (int row = 0; row < h; ++row) {
    const float* const in = &scratch.At(0, row);
    const float* const above = &scratch.At(0, std::max(0, row - 1));
    const float* const below = &scratch.At(0, std::min(h - 1, row + 1));
    float* const out = &plane.At(0, row);
    for (int c = 0; c < w; ++c) out[c] = 0.5F * in[c] + 0.25F * (above[c] + below[c]);
  }
}

}  // namespace torquer::effects
