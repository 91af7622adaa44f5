#include "host/simulator/vessel/triangle_bvh.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "tests/support/made_meshes.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Eigen::Vector3d;

double SegmentDistance(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
  return (p - a - t * (b - a)).norm();
}

// Independent of the tree: height over the plane if the foot is inside, otherwise the edges.
double PlainDistance(const TriangleMesh& mesh, const Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Vector3d &a = mesh.Corner(i, 0), &b = mesh.Corner(i, 1), &c = mesh.Corner(i, 2);
    const Vector3d n = (b - a).cross(c - a).normalized();
    const Vector3d foot = p - n.dot(p - a) * n;
    const bool within = n.dot((b - a).cross(foot - a)) >= 0 &&
                        n.dot((c - b).cross(foot - b)) >= 0 && n.dot((a - c).cross(foot - c)) >= 0;
    least = std::min(least, within ? std::abs(n.dot(p - a))
                                   : std::min({SegmentDistance(p, a, b), SegmentDistance(p, b, c),
                                               SegmentDistance(p, c, a)}));
  }
  return least;
}

TriangleMesh Bottle() {
  TriangleMesh mesh = MakeTubeMesh(40, 20, 24, [](double x) { return 3 + std::sin(x / 3); });
  CapTubeMesh(mesh);
  return mesh;
}

TEST_CASE("distances are those of looking at every triangle, and signs those of winding") {
  const TriangleBvh bvh(Bottle());
  Random random(21);
  for (int i = 0; i < 3000; ++i) {
    const Vector3d p = random.InBox({-8, -8, -8}, {48, 8, 8});
    const double distance = bvh.Distance(p);
    CHECK(std::abs(distance) == Approx(PlainDistance(bvh.mesh(), p)).margin(1e-10));
    const double winding = bvh.WindingNumber(p);
    CHECK((winding > 0.5) == (distance > 0));
    CHECK(std::min(std::abs(winding), std::abs(winding - 1)) < 0.05);
    const TriangleBvh::Nearest nearest = bvh.NearestTo(p);
    CHECK((nearest.point_mm - p).norm() == Approx(std::abs(distance)).margin(1e-12));
  }
}

TEST_CASE("rounded winding numbers on both sides of a face are those of single look-ups") {
  TriangleMesh mesh = Bottle(), other = Bottle();
  for (Vector3d& v : other.vertices_mm) v = Vector3d(20 - v.y(), v.x() - 18, v.z() + 0.4);
  Append(mesh, other);
  const TriangleBvh bvh(mesh);
  int within = 0;
  for (size_t face = 0; face < mesh.triangles.size(); ++face) {
    const Vector3d at = mesh.Centroid(face);
    const Vector3d step = 1e-4 * mesh.DoubleArea(face).normalized();
    const auto [outer, inner] = bvh.WholeWindingNumbers(at, step);
    CHECK(outer == std::lround(bvh.WindingNumber(at + step)));
    CHECK(inner == std::lround(bvh.WindingNumber(at - step)));
    within += outer == 1 ? 1 : 0;
  }
  CHECK(within > 50);
}

TEST_CASE("crossings of rays give the winding numbers of a closed surface, and of one with a lid") {
  TriangleMesh mesh = Bottle(), other = Bottle();
  for (Vector3d& v : other.vertices_mm) v = Vector3d(20 - v.y(), v.x() - 18, v.z() + 0.4);
  Append(mesh, other);
  const std::size_t missing = GENERATE(std::size_t{0}, std::size_t{2}, std::size_t{9});
  for (std::size_t i = 0; i < missing; ++i) {
    mesh.triangles.erase(mesh.triangles.begin() + static_cast<std::ptrdiff_t>(100 * i + 7));
  }
  const TriangleBvh bvh(mesh, TriangleBvh::Signs::kNone);
  const TriangleMesh cones = repair::ConesOverBorder(mesh);
  CHECK(cones.triangles.size() == missing);
  std::optional<TriangleBvh> lid;
  if (missing > 0) lid.emplace(cones, TriangleBvh::Signs::kNone);
  std::size_t counted = 0, within = 0;
  for (std::size_t face = 0; face < mesh.triangles.size(); ++face) {
    const Vector3d at = mesh.Centroid(face);
    const Vector3d step = 1e-4 * mesh.DoubleArea(face).normalized();
    const auto sides = bvh.CountCrossings(at, step, lid ? &*lid : nullptr);
    if (!sides) continue;
    ++counted;
    CHECK(sides->outer == std::lround(bvh.WindingNumber(at + step)));
    CHECK(sides->inner == std::lround(bvh.WindingNumber(at - step)));
    within += sides->outer == 1 ? 1 : 0;
  }
  CHECK(counted > 0.9 * static_cast<double>(mesh.triangles.size()));
  CHECK(within > 50);
}

TEST_CASE("signs are right next to edges and corners, where faces disagree") {
  const TriangleBvh bvh(Bottle());
  Random random(22);
  for (int i = 0; i < 3000; ++i) {
    const auto& mesh = bvh.mesh();
    const size_t triangle = random.Next() % mesh.triangles.size();
    const double t = i % 3 == 0 ? 0 : random.Uniform(0, 1);
    const Vector3d at = (1 - t) * mesh.Corner(triangle, 0) + t * mesh.Corner(triangle, 1);
    const Vector3d p = at + 1e-3 * random.Direction();
    CHECK((bvh.WindingNumber(p) > 0.5) == (bvh.Distance(p) > 0));
  }
}

TEST_CASE("a grid of samples is what single look-ups give, to the bit, as far as they are needed") {
  const TriangleBvh bvh(Bottle());
  Random random(23);
  int replaced = 0;
  for (const double step : {0.25, 2.0, 16.0}) {
    for (int i = 0; i < 20; ++i) {
      const Vector3d corner = random.InBox({-10, -10, -10}, {45, 5, 5});
      constexpr int kCount = 7;
      double x[kCount], y[kCount], z[kCount], out[kCount * kCount * kCount];
      for (int k = 0; k < kCount; ++k) {
        x[k] = corner.x() + k * step;
        y[k] = corner.y() + k * step;
        z[k] = corner.z() + k * step;
      }
      for (const double needed_mm : {std::numeric_limits<double>::infinity(), 6.0, 0.5}) {
        bvh.SampleGrid(x, y, z, kCount, needed_mm, out);
        for (int n = 0; n < kCount * kCount * kCount; ++n) {
          const double distance =
              bvh.Distance({x[n % kCount], y[n / kCount % kCount], z[n / kCount / kCount]});
          if (out[n] == distance) continue;
          ++replaced;
          CHECK(std::abs(distance) > needed_mm);
          CHECK(std::abs(out[n]) > needed_mm);
        }
      }
    }
  }
  CHECK(replaced > 1000);
}

TEST_CASE("the bricks of a surface are those of its single look-ups, to the bit") {
  const auto surface = std::make_shared<const TriangleBvh>(Bottle());
  Eigen::AlignedBox3d bounds_mm;
  for (const Vector3d& vertex : surface->mesh().vertices_mm) bounds_mm.extend(vertex);
  BrickFieldOptions options;
  options.voxel_mm = 1;
  options.margin_mm = 20;
  const auto checksums = [](const BrickField& field) {
    CHECK(field.Build(0, 1));
    std::vector<uint64_t> sums;
    for (const StoredBrick& brick : field.StoredBricks()) sums.push_back(brick.Checksum());
    std::sort(sums.begin(), sums.end());
    return sums;
  };
  const auto single = BrickField::FromFunction(
      [&](const Vector3d& p) { return surface->Distance(p); }, bounds_mm, options);
  const auto sums = checksums(BrickField(surface, bounds_mm, options));
  CHECK(sums.size() > 20);
  CHECK(sums == checksums(*single));
}

TEST_CASE("rays hit the nearest face") {
  const TriangleBvh bvh(MakeClosedTube(40, 3));
  CHECK(bvh.CastRay({20, 0, 0}, Vector3d::UnitX(), 0) == Approx(20));
  CHECK(bvh.CastRay({20, 0, 0}, Vector3d(0, 1, 0), 0) == Approx(3).margin(0.03));
  CHECK(bvh.CastRay({20, 10, 0}, Vector3d(0, -1, 0), 0) == Approx(7).margin(0.03));
  CHECK(std::isinf(bvh.CastRay({20, 10, 0}, Vector3d::UnitX(), 0)));
}

TEST_CASE("a ray meets a part if it hits a triangle of it beyond the least distance") {
  TriangleMesh mesh = MakeClosedTube(40, 3);
  const size_t first = mesh.triangles.size();
  const TriangleMesh tube = mesh;
  const auto offset = static_cast<int32_t>(mesh.vertices_mm.size());
  for (const Vector3d& vertex : tube.vertices_mm)
    mesh.vertices_mm.emplace_back(vertex + Vector3d(0, 20, 0));
  for (const auto& t : tube.triangles)
    mesh.triangles.push_back({t[0] + offset, t[1] + offset, t[2] + offset});
  std::vector<int> parts(mesh.triangles.size(), 1);
  std::fill_n(parts.begin(), first, 0);
  const TriangleBvh bvh(mesh);
  const auto meets = [&](const Vector3d& from_mm, const Vector3d& direction, double least_mm,
                         int part) {
    return bvh.RayMeetsPart(from_mm, direction, least_mm, parts, part);
  };
  CHECK(meets({20, 10, 0}, Vector3d(0, -1, 0), 0, 0));
  CHECK_FALSE(meets({20, 10, 0}, Vector3d(0, -1, 0), 0, 1));
  CHECK(meets({20, 10, 0}, Vector3d(0, -1, 0), 8, 0));  // the far wall
  CHECK_FALSE(meets({20, 10, 0}, Vector3d(0, -1, 0), 14, 0));
  // Through the first tube into the second.
  CHECK(meets({20, 0, 0}, Vector3d(0, 1, 0), 0, 1));
  CHECK_FALSE(meets({20, 10, 0}, Vector3d::UnitX(), 0, 0));
}

TEST_CASE("a clean surface has no doubtful place") {
  const TriangleBvh bvh(Bottle());
  for (size_t i = 0; i < bvh.mesh().triangles.size(); ++i) {
    CHECK_FALSE(bvh.IsDoubtful(static_cast<int32_t>(i)));
  }
  CHECK(bvh.FindIntersections(10).empty());
}

}  // namespace
}  // namespace torquer::vessel
