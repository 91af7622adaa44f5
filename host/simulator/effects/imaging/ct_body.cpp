#include "host/simulator/effects/imaging/ct_body.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "host/simulator/effects/imaging/picture_band.h"

namespace torquer::effects {

using Eigen::Vector3d;

namespace {

constexpr double kBeyondMm = 200;  // by which the body continues beyond the scan
constexpr double kTissueHu = 50;
constexpr int kCoarseRays = 128;       // in a row of a coarse picture
constexpr int kPartRows = 8;           // rows that share slices of the scan in the cache
constexpr int kRaysPerPicture = 8192;  // fine ones: 16 rows of 512

int PartCount(const Plane& plane) { return (plane.height + kPartRows - 1) / kPartRows; }

// Parts in the order of their distance from the middle of `count` parts.
int PartAt(int place, int count) {
  const int middle = count / 2;
  const int away = (place + 1) / 2;
  return place % 2 == 1 ? middle - away : middle + away;
}

}  // namespace

// Rays of a group of pixels in the lattice of a level. `main` is the axis whose slices they cross,
// u and v are the others.
struct CtBody::Rays {
  struct Ray {
    float u = 0, v = 0;            // at slice 0
    float u_step = 0, v_step = 0;  // to the next slice
    int begin = 0, end = 0;        // slices
    float mm = 0;                  // from slice to slice
    float sum = 0;
  };
  int main = 0, u = 1, v = 2;
  std::vector<Ray> all;
};

CtBody::CtBody(CtVolume volume, const CtAttenuation& attenuation, const Vector3d& superior)
    : tissue_1_mm_(attenuation.Of(kTissueHu)),
      file_hash_(volume.file_hash),
      fine_volume_(std::move(volume)) {
  const auto highest = std::max_element(fine_volume_.values.begin(), fine_volume_.values.end());
  constexpr double kMost = 32767;
  unit_1_mm_ = std::max(attenuation.Of(*highest), tissue_1_mm_) / kMost;
  constexpr int kLowest = -32768;
  std::vector<std::int16_t> table(65536);
  for (std::size_t n = 0; n < table.size(); ++n) {
    const double units = attenuation.Of(kLowest + static_cast<double>(n)) / unit_1_mm_;
    table[n] = static_cast<std::int16_t>(std::lround(std::min(kMost, units)));
  }
  for (std::int16_t& value : fine_volume_.values) {
    value = table[static_cast<std::size_t>(value - kLowest)];
  }
  half_volume_ = Halved(fine_volume_);
  int long_axis = 0;
  (fine_volume_.step_mm.colwise().normalized().transpose() * superior)
      .cwiseAbs()
      .maxCoeff(&long_axis);
  fine_ = LevelOf(fine_volume_, long_axis);
  half_ = LevelOf(half_volume_, long_axis);
}

// Means of 2 x 2 x 2 voxels. A last odd voxel counts twice.
CtVolume CtBody::Halved(const CtVolume& volume) {
  CtVolume half;
  for (std::size_t a = 0; a < 3; ++a) half.size[a] = std::max(2, (volume.size[a] + 1) / 2);
  half.step_mm = 2 * volume.step_mm;
  half.first_mm = volume.first_mm + volume.step_mm * Vector3d::Constant(0.5);
  const std::array<std::ptrdiff_t, 3> strides = volume.Strides();
  const auto offsets = [&](int axis, int at) {
    const auto a = static_cast<std::size_t>(axis);
    const int last = volume.size[a] - 1;
    return std::array<std::ptrdiff_t, 2>{std::min(2 * at, last) * strides[a],
                                         std::min(2 * at + 1, last) * strides[a]};
  };
  half.values.reserve(static_cast<std::size_t>(half.size[0]) *
                      static_cast<std::size_t>(half.size[1]) *
                      static_cast<std::size_t>(half.size[2]));
  for (int k = 0; k < half.size[2]; ++k) {
    for (int j = 0; j < half.size[1]; ++j) {
      for (int i = 0; i < half.size[0]; ++i) {
        int sum = 0;
        for (const std::ptrdiff_t slice : offsets(2, k)) {
          for (const std::ptrdiff_t row : offsets(1, j)) {
            for (const std::ptrdiff_t column : offsets(0, i)) {
              sum += volume.values[static_cast<std::size_t>(slice + row + column)];
            }
          }
        }
        half.values.push_back(static_cast<std::int16_t>((sum + 4) / 8));
      }
    }
  }
  return half;
}

CtBody::Level CtBody::LevelOf(const CtVolume& volume, int long_axis) const {
  Level level;
  level.size = volume.size;
  level.strides = volume.Strides();
  level.to_index = volume.step_mm.inverse();
  level.first_mm = volume.first_mm;
  level.values = volume.values.data();
  level.beyond[static_cast<std::size_t>(long_axis)] =
      static_cast<int>(kBeyondMm / volume.step_mm.col(long_axis).norm());
  return level;
}

// Axis along which the middle ray advances by the most voxels.
int CtBody::MainAxis(const Level& level, const Projection& projection) {
  int axis = 0;
  (level.to_index * projection.camera().row(2).transpose()).cwiseAbs().maxCoeff(&axis);
  return axis;
}

void CtBody::Aim(const Level& level, int axis, const Projection& projection, const Pixels& pixels,
                 Rays& rays) {
  rays.main = axis;
  rays.u = axis == 0 ? 1 : 0;
  rays.v = axis == 2 ? 1 : 2;
  rays.all.clear();
  const Vector3d source = level.to_index * (projection.source_mm() - level.first_mm);
  const Eigen::Matrix3d to_index = level.to_index * projection.camera().transpose();
  for (int r = 0; r < pixels.rows; ++r) {
    for (int c = 0; c < pixels.columns; ++c) {
      const Vector3d slope(projection.RightOf(pixels.first_column + c * pixels.step),
                           projection.UpOf(pixels.first_row + r * pixels.step), 1);
      const Vector3d ray = to_index * slope;
      Rays::Ray& out = rays.all.emplace_back();
      const double along = ray[axis];
      constexpr double kLeast = 1e-6;
      if (std::abs(along) < kLeast) continue;
      // Slices in front of the source and within the scan.
      double low = -1e9;
      double high = 1e9;
      Narrow(kNearestMm + source[axis] / along, -1 / along, low, high);
      for (int a = 0; a < 3; ++a) {
        const auto k = static_cast<std::size_t>(a);
        const double step = ray[a] / along;
        const double at = source[a] - source[axis] * step;
        Narrow(-level.beyond[k] - at, -step, low, high);
        Narrow(at - (level.size[k] - 1 + level.beyond[k]), step, low, high);
      }
      if (!(low <= high)) continue;
      out.u_step = static_cast<float>(ray[rays.u] / along);
      out.v_step = static_cast<float>(ray[rays.v] / along);
      out.u = static_cast<float>(source[rays.u] - source[axis] * ray[rays.u] / along);
      out.v = static_cast<float>(source[rays.v] - source[axis] * ray[rays.v] / along);
      out.begin = static_cast<int>(std::ceil(low));
      out.end = static_cast<int>(std::floor(high)) + 1;
      out.mm = static_cast<float>(slope.norm() / std::abs(along));
    }
  }
}

void CtBody::Integrate(const Level& level, const Projection& projection, const Pixels& pixels,
                       float* integrals) const {
  Rays rays;
  Aim(level, MainAxis(level, projection), projection, pixels, rays);
  int begin = level.size[static_cast<std::size_t>(rays.main)] + level.beyond[0] + level.beyond[1] +
              level.beyond[2];
  int end = -begin;
  for (const Rays::Ray& ray : rays.all) {
    if (ray.begin >= ray.end) continue;
    begin = std::min(begin, ray.begin);
    end = std::max(end, ray.end);
  }
  const auto size = [&](int axis) { return level.size[static_cast<std::size_t>(axis)]; };
  const std::ptrdiff_t u_stride = level.strides[static_cast<std::size_t>(rays.u)];
  const std::ptrdiff_t v_stride = level.strides[static_cast<std::size_t>(rays.v)];
  const int last_u = size(rays.u) - 2;
  const int last_v = size(rays.v) - 2;
  const auto most_u = static_cast<float>(size(rays.u) - 1);
  const auto most_v = static_cast<float>(size(rays.v) - 1);
  for (int s = begin; s < end; ++s) {
    const std::ptrdiff_t slice = std::clamp(s, 0, size(rays.main) - 1);
    const std::int16_t* const values =
        level.values + slice * level.strides[static_cast<std::size_t>(rays.main)];
    const auto at = static_cast<float>(s);
    for (Rays::Ray& ray : rays.all) {
      if (s < ray.begin || s >= ray.end) continue;
      const float u = std::clamp(ray.u + at * ray.u_step, 0.0F, most_u);
      const float v = std::clamp(ray.v + at * ray.v_step, 0.0F, most_v);
      const int u_low = std::min(static_cast<int>(u), last_u);
      const int v_low = std::min(static_cast<int>(v), last_v);
      const float u_share = u - static_cast<float>(u_low);
      const float v_share = v - static_cast<float>(v_low);
      const std::int16_t* const cell = values + u_low * u_stride + v_low * v_stride;
      const auto a = static_cast<float>(cell[0]);
      const auto b = static_cast<float>(cell[u_stride]);
      const auto c = static_cast<float>(cell[v_stride]);
      const auto d = static_cast<float>(cell[u_stride + v_stride]);
      const float near = a + u_share * (b - a);
      const float far = c + u_share * (d - c);
      ray.sum += near + v_share * (far - near);
    }
  }
  const auto unit = static_cast<float>(unit_1_mm_);
  for (std::size_t n = 0; n < rays.all.size(); ++n) {
    integrals[n] = unit * rays.all[n].mm * rays.all[n].sum;
  }
}

double CtBody::MiddleIntegral(const Projection& projection) const {
  const ImagePoint middle =
      projection.Project(projection.source_mm() + projection.camera().row(2).transpose());
  float integral = 0;
  Integrate(fine_, projection, {.first_column = middle.column, .first_row = middle.row}, &integral);
  return static_cast<double>(integral);
}

float CtBody::FillCoarsely(const Projection& projection, Plane& plane) const {
  const int step = std::max(4, (plane.width + kCoarseRays - 1) / kCoarseRays);
  PlaneGrid grid(plane, step);
  for (int row = 0; row < grid.rows; row += kPartRows) {
    Integrate(half_, projection,
              {.first_column = 0,
               .first_row = static_cast<double>(row * step),
               .columns = grid.columns,
               .rows = std::min(kPartRows, grid.rows - row),
               .step = step},
              &grid.At(0, row));
  }
  plane.Clear(plane.width, plane.height);
  grid.AddTo(plane);
  double sum = 0;
  int measured = 0;
  for (int row = 0; row < grid.rows; ++row) {
    for (int column = 0; column < grid.columns; ++column) {
      if (!grid.IsMiddle(column, row)) continue;
      sum += static_cast<double>(grid.At(column, row));
      ++measured;
    }
  }
  return static_cast<float>(sum / measured);
}

int CtBody::FineParts(std::int64_t still, const Plane& plane) {
  const std::int64_t each = std::max(1, kRaysPerPicture / (kPartRows * plane.width));
  const std::int64_t count = PartCount(plane);
  return static_cast<int>(still >= count ? count : std::min(count, still * each));
}

void CtBody::Refine(const Projection& projection, int from, int to, Plane& plane) const {
  for (int place = from; place < to; ++place) {
    const int row = kPartRows * PartAt(place, PartCount(plane));
    Integrate(fine_, projection,
              {.first_column = 0,
               .first_row = static_cast<double>(row),
               .columns = plane.width,
               .rows = std::min(kPartRows, plane.height - row)},
              &plane.At(0, row));
  }
}

}  // namespace torquer::effects
