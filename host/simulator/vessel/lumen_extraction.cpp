#include "host/simulator/vessel/lumen_extraction.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "host/simulator/vessel/arc_line_path.h"
#include "host/simulator/vessel/face_sample.h"
#include "host/simulator/vessel/mesh_edges.h"
#include "host/simulator/vessel/mesh_repair.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

constexpr int kRays = 48;
constexpr int kSampleRays = 24;
constexpr size_t kSampleFaces = 400;
// A face looks into a tube if at least this share of its rays meets the surface again.
constexpr double kInTube = 0.75;
constexpr int kDiffusionSteps = 20;

// Share of the rays in the hemisphere about a face's normal that meet the face's own part again.
// Other parts are beside it and are no wall around it. The rays are spiral points, evenly spread
// over the solid angle. The flattest tenth is omitted: it would graze the face's neighbors.
double ReturningShare(const TriangleBvh& surface, const std::vector<int>& parts, size_t face,
                      int rays) {
  const TriangleMesh& mesh = surface.mesh();
  const Vector3d normal = mesh.DoubleArea(face).normalized();
  const Vector3d x = AnyOrthogonal(normal), y = normal.cross(x);
  const Vector3d from = mesh.Centroid(face);
  const double golden = M_PI * (3 - std::sqrt(5.0));
  int met = 0;
  for (int r = 0; r < rays; ++r) {
    const double height = 0.1 + 0.9 * (r + 0.5) / rays;
    const double wide = std::sqrt(1 - height * height), angle = golden * r;
    const Vector3d direction = height * normal + wide * (std::cos(angle) * x + std::sin(angle) * y);
    met += surface.RayMeetsPart(from, direction, 1e-6, parts, parts[face]) ? 1 : 0;
  }
  return static_cast<double>(met) / rays;
}

}  // namespace

double TubeFacingShare(const TriangleBvh& surface) {
  int part_count = 0;
  const std::vector<int> parts = repair::Parts(surface.mesh(), &part_count);
  double facing_mm2 = 0, total_mm2 = 0;
  for (const auto& [face, weight_mm2] : SampleFaces(surface.mesh(), kSampleFaces)) {
    total_mm2 += weight_mm2;
    if (ReturningShare(surface, parts, face, kSampleRays) >= kInTube) facing_mm2 += weight_mm2;
  }
  return total_mm2 > 0 ? facing_mm2 / total_mm2 : 0;
}

TriangleMesh InnerSide(const TriangleBvh& surface) {
  const TriangleMesh& mesh = surface.mesh();
  const size_t count = mesh.triangles.size();
  const EdgeTable edges(mesh);
  int part_count = 0;
  const std::vector<int> parts = repair::Parts(mesh, &part_count);
  std::vector<double> area(count), vote(count);
  for (size_t i = 0; i < count; ++i) {
    area[i] = mesh.DoubleArea(i).norm() / 2;
    vote[i] = ReturningShare(surface, parts, i, kRays);
  }
  std::vector<std::vector<int32_t>> neighbors(count);
  for (const auto& [edge, uses] : edges) {
    if (uses.size() != 2) continue;
    const int32_t one = uses[0].triangle, two = uses[1].triangle;
    // The rim of a wall is a sharp edge, so votes do not pass over it.
    if (mesh.DoubleArea(one).normalized().dot(mesh.DoubleArea(two).normalized()) < 0.3) continue;
    neighbors[one].push_back(two);
    neighbors[two].push_back(one);
  }
  for (int step = 0; step < kDiffusionSteps; ++step) {
    std::vector<double> next(count);
    for (size_t i = 0; i < count; ++i) {
      double sum = 2 * area[i] * vote[i], weight = 2 * area[i];
      for (const int32_t n : neighbors[i]) {
        sum += area[n] * vote[n];
        weight += area[n];
      }
      next[i] = weight > 0 ? sum / weight : vote[i];
    }
    vote = std::move(next);
  }
  std::vector<char> inner(count);
  for (size_t i = 0; i < count; ++i) inner[i] = vote[i] >= kInTube - 0.2;
  // The largest connected part of each side stays; smaller parts change sides.
  for (const char side : {char{1}, char{0}, char{1}}) {
    std::vector<int32_t> parent(count);
    std::iota(parent.begin(), parent.end(), 0);
    const auto root = [&](int32_t i) {
      while (parent[i] != i) i = parent[i] = parent[parent[i]];
      return i;
    };
    for (const auto& [edge, uses] : edges) {
      const int32_t one = uses[0].triangle;
      for (const EdgeUse& use : uses) {
        if (inner[one] == side && inner[use.triangle] == side)
          parent[root(one)] = root(use.triangle);
      }
    }
    std::vector<double> part_area(count, 0);
    for (size_t i = 0; i < count; ++i) part_area[root(static_cast<int32_t>(i))] += area[i];
    double largest = 0;
    for (size_t i = 0; i < count; ++i) {
      if (inner[i] == side) largest = std::max(largest, part_area[root(static_cast<int32_t>(i))]);
    }
    std::vector<char> next = inner;
    for (size_t i = 0; i < count; ++i) {
      if (inner[i] == side && part_area[root(static_cast<int32_t>(i))] < largest) {
        next[i] = static_cast<char>(!side);
      }
    }
    inner = std::move(next);
  }
  TriangleMesh lumen;
  lumen.vertices_mm = mesh.vertices_mm;
  for (size_t i = 0; i < count; ++i) {
    if (!inner[i]) continue;
    const auto& triangle = mesh.triangles[i];
    lumen.triangles.push_back({triangle[0], triangle[2], triangle[1]});
  }
  return lumen;
}

}  // namespace torquer::vessel
