#include "host/recorder/vessel_shading.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <map>
#include <utility>

namespace torquer {
namespace {

using Corners = std::array<Eigen::Vector3d, 3>;

struct LitTriangle {
  Corners points;   // as seen
  Corners normals;  // outward, interpolated from the surface around
  double outward;   // 1 when (b - a) x (c - a) points out of the lumen, else -1
};

// Number of times that each normal is averaged with its neighbors: scanned surfaces are coarse and
// rough.
constexpr int kSmoothingRounds = 2;

// Points that differ only by rounding in a file are one vertex.
std::array<std::int64_t, 3> VertexKey(const Eigen::Vector3d& point) {
  constexpr double kPerMm = 1e4;
  return {std::llround(point.x() * kPerMm), std::llround(point.y() * kPerMm),
          std::llround(point.z() * kPerMm)};
}

using VertexNormals = std::map<std::array<std::int64_t, 3>, Eigen::Vector3d>;

// Averages each normal with those of the vertices it shares a triangle with.
void Smooth(const std::vector<LitTriangle>& triangles, VertexNormals& normals) {
  VertexNormals sums;
  for (const LitTriangle& triangle : triangles) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& point : triangle.points) sum += normals.at(VertexKey(point));
    for (const Eigen::Vector3d& point : triangle.points) {
      sums.try_emplace(VertexKey(point), Eigen::Vector3d::Zero()).first->second += sum;
    }
  }
  for (auto& [key, normal] : normals) normal = sums.at(key).stableNormalized();
}

std::vector<LitTriangle> WithNormals(const PictureVessel& vessel, const PatientAxes& axes) {
  std::vector<LitTriangle> triangles;
  triangles.reserve(vessel.triangles_mm.size());
  VertexNormals normal_sums;
  double volume = 0;
  for (const Corners& corners : vessel.triangles_mm) {
    LitTriangle triangle{};
    for (std::size_t i = 0; i < 3; ++i) {
      triangle.points[i] = SeenFromTheFront(axes, corners[i]);
    }
    const auto& [a, b, c] = triangle.points;
    volume += a.dot(b.cross(c));
    const Eigen::Vector3d area_normal = (b - a).cross(c - a);
    for (const Eigen::Vector3d& point : triangle.points) {
      normal_sums.try_emplace(VertexKey(point), Eigen::Vector3d::Zero()).first->second +=
          area_normal;
    }
    triangles.push_back(triangle);
  }
  const double outward = volume < 0 ? -1.0 : 1.0;
  for (auto& [key, normal] : normal_sums) normal = outward * normal.stableNormalized();
  for (int round = 0; round < kSmoothingRounds; ++round) Smooth(triangles, normal_sums);
  for (LitTriangle& triangle : triangles) {
    triangle.outward = outward;
    for (std::size_t i = 0; i < 3; ++i) {
      triangle.normals[i] = normal_sums.at(VertexKey(triangle.points[i]));
    }
  }
  return triangles;
}

// Length of the longest projected side, and the corner where it starts.
std::pair<double, std::size_t> LongestSide(const LitTriangle& triangle) {
  std::pair<double, std::size_t> longest{0, 0};
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d side = triangle.points[(i + 1) % 3] - triangle.points[i];
    longest = std::max(longest, {side.head<2>().norm(), i});
  }
  return longest;
}

double LongestAllowed(const LitTriangle& triangle, const ShadingDetail& detail) {
  Eigen::AlignedBox2d seen;
  for (const Eigen::Vector3d& point : triangle.points) seen.extend(point.head<2>().eval());
  return detail.fine_region_mm.intersects(seen) ? detail.fine_side_mm : detail.side_mm;
}

// Halves the longest side of each triangle until no side is above the limit. If that gives too many
// triangles, returns false and leaves `triangles` unchanged.
bool Divide(std::vector<LitTriangle>& triangles, const ShadingDetail& detail, double scale) {
  std::vector<LitTriangle> divided = triangles;
  for (std::size_t i = 0; i < divided.size();) {
    const auto [length, start] = LongestSide(divided[i]);
    if (length <= scale * LongestAllowed(divided[i], detail)) {
      ++i;
      continue;
    }
    if (divided.size() >= detail.most_triangles) return false;
    const std::size_t end = (start + 1) % 3;
    LitTriangle& triangle = divided[i];
    const Eigen::Vector3d middle = 0.5 * (triangle.points[start] + triangle.points[end]);
    const Eigen::Vector3d normal =
        (triangle.normals[start] + triangle.normals[end]).stableNormalized();
    LitTriangle other = triangle;
    triangle.points[end] = middle;
    triangle.normals[end] = normal;
    other.points[start] = middle;
    other.normals[start] = normal;
    divided.push_back(other);
  }
  triangles = std::move(divided);
  return true;
}

// Lighting model: a lamp above the viewer's left shoulder, and darkened rims as on a glass tube.
double Light(const Eigen::Vector3d& normal_to_viewer) {
  static const Eigen::Vector3d lamp = Eigen::Vector3d(-0.45, 0.45, -0.77).normalized();
  const double facing = std::clamp(-normal_to_viewer.z(), 0.0, 1.0);
  const double diffuse = std::max(normal_to_viewer.dot(lamp), 0.0);
  const Eigen::Vector3d half = (lamp - Eigen::Vector3d::UnitZ()).normalized();
  const double gloss = std::pow(std::max(normal_to_viewer.dot(half), 0.0), 24.0);
  return std::clamp(0.18 + 0.52 * diffuse + 0.14 * facing + 0.20 * gloss, 0.0, 1.0);
}

}  // namespace

Eigen::Vector3d SeenFromTheFront(const PatientAxes& axes, const Eigen::Vector3d& point_mm) {
  return {axes.left.dot(point_mm), axes.superior.dot(point_mm), axes.posterior.dot(point_mm)};
}

ShadedVessel ShadeVessel(const PictureVessel& vessel, const PatientAxes& axes,
                         const ShadingDetail& detail) {
  std::vector<LitTriangle> triangles = WithNormals(vessel, axes);
  if (triangles.size() < detail.most_triangles) {
    double scale = 1;
    while (!Divide(triangles, detail, scale)) scale *= 1.2;
  }
  std::sort(triangles.begin(), triangles.end(), [](const LitTriangle& a, const LitTriangle& b) {
    return a.points[0].z() + a.points[1].z() + a.points[2].z() >
           b.points[0].z() + b.points[1].z() + b.points[2].z();
  });
  ShadedVessel shaded;
  for (const LitTriangle& triangle : triangles) {
    const auto& [a, b, c] = triangle.points;
    const bool near = triangle.outward * (b - a).cross(c - a).z() < 0;
    const Eigen::Vector3d normal =
        (triangle.normals[0] + triangle.normals[1] + triangle.normals[2]).stableNormalized();
    ShadedTriangle result;
    for (std::size_t i = 0; i < 3; ++i) {
      result.corners_mm[i] = triangle.points[i].template head<2>();
    }
    result.light = Light(near ? normal : Eigen::Vector3d(-normal));
    (near ? shaded.near_wall : shaded.far_wall).push_back(result);
  }
  return shaded;
}

}  // namespace torquer
