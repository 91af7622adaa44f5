#include "host/simulator/effects/imaging/lumen_painter.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/effects/imaging/picture_band.h"

namespace torquer::effects {

using Eigen::Vector3d;

// Truncated cone in the camera's frame, cut off by two planes.
struct LumenPainter::Cone {
  Vector3d begin, end, axis, begin_normal, end_normal;
  double length = 0, begin_radius = 0, end_radius = 0;
  float begin_attenuation = 0, end_attenuation = 0;
};

void LumenPainter::Begin(int width, int height) {
  const std::size_t size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  width_ = width;
  height_ = height;
  pixels_.resize(size);
  counts_.assign(size, 0);
  beyond_.resize(size, 0.0F);
  own_.resize(size);
  has_own_.resize(size, 0);
  first_row_ = height;
  last_row_ = -1;
}

void LumenPainter::Add(const Projection& projection, const LumenPoint* points, std::size_t count) {
  for (std::size_t i = 1; i < count; ++i) {
    const LumenPoint& a = points[i - 1];
    const LumenPoint& b = points[i];
    if (!(a.attenuation_1_mm > 1e-6F) && !(b.attenuation_1_mm > 1e-6F)) continue;
    Cone cone;
    cone.begin = projection.ToCamera(a.position_mm);
    cone.end = projection.ToCamera(b.position_mm);
    cone.axis = cone.end - cone.begin;
    cone.length = cone.axis.norm();
    if (cone.length < 1e-9 || cone.begin[2] < kNearestMm || cone.end[2] < kNearestMm) continue;
    cone.axis /= cone.length;
    cone.begin_normal = projection.camera() * a.tangent;
    cone.end_normal = projection.camera() * b.tangent;
    // At a sharp corner the planes would cut the cone to pieces, so the cone's own axis is used.
    constexpr double kLeastCosine = 0.5;
    if (cone.begin_normal.dot(cone.axis) < kLeastCosine) cone.begin_normal = cone.axis;
    if (cone.end_normal.dot(cone.axis) < kLeastCosine) cone.end_normal = cone.axis;
    cone.begin_radius = a.radius_mm;
    cone.end_radius = b.radius_mm;
    cone.begin_attenuation = a.attenuation_1_mm;
    cone.end_attenuation = b.attenuation_1_mm;
    Paint(projection, cone);
  }
  for (const std::size_t pixel : own_pixels_) {
    has_own_[pixel] = 0;
    Insert(pixel, own_[pixel]);
  }
  own_pixels_.clear();
}

// Cones of one vessel lie in a pixel side by side or behind each other, so their lengths add up. If
// the gap between them exceeds `apart_mm`, the vessel passes the pixel twice.
void LumenPainter::Collect(std::size_t pixel, const Stretch& stretch, float apart_mm) {
  Stretch& own = own_[pixel];
  if (has_own_[pixel] == 0) {
    has_own_[pixel] = 1;
    own_pixels_.push_back(pixel);
    own = stretch;
    return;
  }
  if (stretch.near_mm > own.far_mm + apart_mm || stretch.far_mm < own.near_mm - apart_mm) {
    Insert(pixel, own);
    own = stretch;
    return;
  }
  const float sum_mm = own.length_mm + stretch.length_mm;
  const float near_mm = std::min(own.near_mm, stretch.near_mm);
  const float far_mm = std::max(own.far_mm, stretch.far_mm);
  // Cones behind each other are at most as long as their total depth range.
  own = {near_mm, far_mm,
         (own.length_mm * own.attenuation_1_mm + stretch.length_mm * stretch.attenuation_1_mm) /
             sum_mm,
         std::min(1.0F, own.fraction + stretch.fraction), std::min(sum_mm, far_mm - near_mm)};
}

void LumenPainter::Paint(const Projection& projection, const Cone& cone) {
  const ImagePoint from = projection.FromCamera(cone.begin);
  const ImagePoint to = projection.FromCamera(cone.end);
  const double radius = std::max(cone.begin_radius, cone.end_radius);
  const double half_width =
      radius * projection.PixelsPerMm(
                   std::max(kNearestMm, std::min(from.depth_mm, to.depth_mm) - radius)) +
      1;
  double along_column = to.column - from.column;
  double along_row = to.row - from.row;
  const double length = std::hypot(along_column, along_row);
  if (length < 1e-9) {
    along_column = 1;
    along_row = 0;
  } else {
    along_column /= length;
    along_row /= length;
  }
  // The end discs extend beyond the line if the vessel runs along the ray or its planes are tilted.
  const double tilt =
      std::max(std::abs(cone.axis[2]) + 0.2,
               std::sqrt(1 - std::min({1.0, std::pow(cone.begin_normal.dot(cone.axis), 2),
                                       std::pow(cone.end_normal.dot(cone.axis), 2)})) +
                   std::abs(cone.axis[2]));
  const double stick_out = half_width * std::min(1.2, tilt) + 1;
  const Band band{from.column, from.row,           along_column, along_row,
                  -stick_out,  length + stick_out, half_width};

  // Rays of a pixel: the thinner the lumen, the more rays. They lie on a lattice in which no two
  // share a row, column or diagonal. For a wide lumen only the middle ray is used.
  constexpr double kWidePx = 5;
  constexpr double kRaysPerRadius = 8;
  struct Lattice {
    int rays, turn;
  };
  constexpr Lattice kLattices[] = {{5, 2}, {13, 5}, {23, 7}, {53, 23}};
  const double radius_px = radius * projection.PixelsPerMm((from.depth_mm + to.depth_mm) / 2);
  Lattice lattice{1, 1};
  for (const Lattice& finer : kLattices) {
    if (radius_px < kWidePx && (lattice.rays == 1 || lattice.rays * radius_px < kRaysPerRadius)) {
      lattice = finer;
    }
  }
  const int rays = lattice.rays;
  int first_row = 0;
  int last_row = -1;
  band.Rows(height_, first_row, last_row);
  first_row_ = std::min(first_row_, first_row);
  last_row_ = std::max(last_row_, last_row);
  for (int row = first_row; row <= last_row; ++row) {
    int first = 0;
    int last = -1;
    if (!band.Columns(row, width_, first, last)) continue;
    for (int column = first; column <= last; ++column) {
      Stretch all{};
      int met = 0;
      for (int ray = 0; ray < rays; ++ray) {
        const double x = (ray + 0.5) / rays - 0.5;
        const double y = (ray * lattice.turn % rays + 0.5) / rays - 0.5;
        Stretch one;
        if (!Meet(cone, projection, column + x, row + y, one)) continue;
        const float own = one.far_mm - one.near_mm;
        all.near_mm = met == 0 ? one.near_mm : std::min(all.near_mm, one.near_mm);
        all.far_mm = met == 0 ? one.far_mm : std::max(all.far_mm, one.far_mm);
        all.attenuation_1_mm += own * one.attenuation_1_mm;
        all.length_mm += own;
        ++met;
      }
      if (met == 0) continue;
      all.attenuation_1_mm /= all.length_mm;
      all.length_mm /= static_cast<float>(rays);
      all.fraction = static_cast<float>(met) / static_cast<float>(rays);
      Collect(static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                  static_cast<std::size_t>(column),
              all, static_cast<float>(2 * radius));
    }
  }
}

// Finds the section of one ray in a cone; returns false without an intersection.
bool LumenPainter::Meet(const Cone& cone, const Projection& projection, double column, double row,
                        Stretch& stretch) {
  // The ray is d z, with z counted from the middle's depth. It is in the cone for a t^2 + 2 b t + c
  // <= 0.
  const double slope = (cone.end_radius - cone.begin_radius) / cone.length;
  const double steep = 1 + slope * slope;
  const double middle_mm = (cone.begin[2] + cone.end[2]) / 2;
  const Vector3d d(projection.RightOf(column), projection.UpOf(row), 1);
  const Vector3d w = middle_mm * d - cone.begin;
  const double d_axis = d.dot(cone.axis);
  const double w_axis = w.dot(cone.axis);
  const double a = d.squaredNorm() - steep * d_axis * d_axis;
  const double b = w.dot(d) - steep * w_axis * d_axis - cone.begin_radius * slope * d_axis;
  const double c = w.squaredNorm() - steep * w_axis * w_axis -
                   2 * cone.begin_radius * slope * w_axis - cone.begin_radius * cone.begin_radius;
  constexpr double kAlongTheAxis = 1e-6;
  double low = -1e4;
  double high = 1e4;
  if (a > kAlongTheAxis) {
    const double discriminant = b * b - a * c;
    if (discriminant <= 0) return false;
    const double root = std::sqrt(discriminant);
    low = (-b - root) / a;
    high = (-b + root) / a;
  }
  Narrow(-w.dot(cone.begin_normal), -d.dot(cone.begin_normal), low, high);
  Narrow((w + cone.begin - cone.end).dot(cone.end_normal), d.dot(cone.end_normal), low, high);
  if (!(low < high)) return false;
  const double t = (low + high) / 2;
  if (a <= kAlongTheAxis && t * (a * t + 2 * b) + c > 0) return false;
  const double fraction = std::clamp((w_axis + t * d_axis) / cone.length, 0.0, 1.0);
  const float attenuation =
      cone.begin_attenuation +
      static_cast<float>(fraction) * (cone.end_attenuation - cone.begin_attenuation);
  stretch = {static_cast<float>(middle_mm + low), static_cast<float>(middle_mm + high), attenuation,
             1, static_cast<float>(high - low)};
  return stretch.far_mm > stretch.near_mm;
}

// Merges touching vessels: in the overlap their union counts. The overlap of their fractions of a
// pixel is assumed to be random. That lies between a branch, which is inside its trunk, and two
// ends side by side.
void LumenPainter::Insert(std::size_t pixel, Stretch stretch) {
  constexpr float kTouchingMm = 2e-3F;
  Stretch* const known = pixels_[pixel].stretch;
  std::uint8_t& count = counts_[pixel];
  if (count == 0) beyond_[pixel] = 0;
  for (int k = 0; k < count;) {
    const Stretch& other = known[k];
    if (stretch.near_mm > other.far_mm + kTouchingMm ||
        stretch.far_mm < other.near_mm - kTouchingMm) {
      ++k;
      continue;
    }
    const float near_mm = std::min(stretch.near_mm, other.near_mm);
    const float far_mm = std::max(stretch.far_mm, other.far_mm);
    const float both = stretch.fraction * other.fraction;
    const float own = stretch.length_mm;
    const float its = other.length_mm;
    stretch.length_mm = own * (1 - both / stretch.fraction) + its * (1 - both / other.fraction) +
                        both * (far_mm - near_mm);
    stretch.attenuation_1_mm = (own * stretch.attenuation_1_mm + its * other.attenuation_1_mm) /
                               std::max(own + its, 1e-9F);
    stretch.fraction += other.fraction - both;
    stretch.near_mm = near_mm;
    stretch.far_mm = far_mm;
    known[k] = known[--count];
  }
  if (count < kStretches) {
    known[count++] = stretch;
  } else {
    beyond_[pixel] += stretch.length_mm * stretch.attenuation_1_mm;
  }
}

void LumenPainter::AddTo(const Projection& projection, Plane& plane) {
  for (int row = first_row_; row <= last_row_; ++row) {
    const double up = projection.UpOf(row);
    for (int column = 0; column < width_; ++column) {
      const std::size_t pixel = static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                                static_cast<std::size_t>(column);
      if (counts_[pixel] == 0) continue;
      float sum = beyond_[pixel];
      for (int k = 0; k < counts_[pixel]; ++k) {
        const Stretch& s = pixels_[pixel].stretch[k];
        sum += s.length_mm * s.attenuation_1_mm;
      }
      const double right = projection.RightOf(column);
      plane.value[pixel] += sum * static_cast<float>(std::sqrt(1 + right * right + up * up));
    }
  }
}

}  // namespace torquer::effects
