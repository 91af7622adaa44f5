#include "host/simulator/vessel/lumen_union.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/simulator/vessel/surface_split.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/support/error.h"
#include "tests/support/made_meshes.h"
#include "tests/support/sanitizer.h"
#include "tests/vessel/field_checks.h"
#include "tests/vessel/union_checks.h"

namespace torquer::vessel {
namespace {

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// Sphere of latitudes and longitudes about the x axis.
TriangleMesh MakeSphere(const Vector3d& center, double radius_mm, int around) {
  const int along = around / 2;
  TriangleMesh mesh = MakeTubeMesh(1, along - 2, around, [](double) { return 1.0; });
  for (int i = 0; i < along - 1; ++i) {
    const double latitude = M_PI * (i + 1) / along;
    for (int j = 0; j < around; ++j) {
      Vector3d& v = mesh.vertices_mm[i * around + j];
      v = {-std::cos(latitude), v.y() * std::sin(latitude), v.z() * std::sin(latitude)};
    }
  }
  CapTubeMesh(mesh, around);
  mesh.vertices_mm[mesh.vertices_mm.size() - 2].x() = -1;
  mesh.vertices_mm.back().x() = 1;
  for (Vector3d& v : mesh.vertices_mm) v = center + radius_mm * v;
  return mesh;
}

void Move(TriangleMesh& mesh, const Eigen::Isometry3d& motion) {
  for (Vector3d& v : mesh.vertices_mm) v = motion * v;
}

Eigen::Isometry3d RandomMotion(Random& random, double reach_mm) {
  const Eigen::AngleAxisd turn(random.Uniform(0, 2 * M_PI), random.Direction());
  const Vector3d reach = Vector3d::Constant(reach_mm);
  return Eigen::Translation3d(random.InBox(-reach, reach)) * turn;
}

// Number of pairs of triangles that cross, including pairs that share a vertex.
int CountCrossings(const TriangleMesh& mesh) {
  // Shrinks each triangle a little, so that triangles that only touch are separated.
  TriangleMesh apart;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto first = static_cast<int32_t>(apart.vertices_mm.size());
    for (int c = 0; c < 3; ++c) {
      apart.vertices_mm.emplace_back(0.9999 * mesh.Corner(i, c) + 1e-4 * mesh.Centroid(i));
    }
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  // Coplanar triangles cross only by rounding, which does not count.
  const auto passes = [&](int32_t face, int32_t other) {
    const Vector3d normal = apart.DoubleArea(face).normalized();
    double low = 0, high = 0;
    for (int c = 0; c < 3; ++c) {
      const double height = normal.dot(apart.Corner(other, c) - apart.Corner(face, 0));
      low = std::min(low, height);
      high = std::max(high, height);
    }
    return low < -1e-6 && high > 1e-6;
  };
  int crossings = 0;
  for (const auto& [one, two] : TriangleBvh(apart).FindIntersections(apart.triangles.size())) {
    crossings += passes(one, two) && passes(two, one) ? 1 : 0;
  }
  return crossings;
}

TEST_CASE("the union of two boxes has the volume of both minus their intersection") {
  Random random(1);
  const AlignedBox3d one(Vector3d(0, 0, 0), Vector3d(10, 6, 4));
  const AlignedBox3d others[] = {
      {Vector3d(4, 2, 1), Vector3d(14, 9, 8)},        // a corner inside
      {Vector3d(3, -2, 1), Vector3d(5, 9, 3)},        // through
      {Vector3d(4, 0, 0), Vector3d(14, 6, 4)},        // four sides in common planes
      {Vector3d(4, 0, 1), Vector3d(14, 6, 3)},        // two sides in common planes
      {Vector3d(10, 1, 1), Vector3d(14, 5, 3)},       // touching, one side within the other's
      {Vector3d(10, 0, 0), Vector3d(14, 6, 4)},       // touching along a whole side
      {Vector3d(1, 1, 1), Vector3d(9, 5, 3)},         // inside
      {Vector3d(1, 1, 0), Vector3d(9, 5, 3)},         // inside, touching from inside
      {Vector3d(9.999, 1, 1), Vector3d(14, 5, 3)},    // barely overlapping
      {Vector3d(2, 1.7, -1), Vector3d(4, 3.1, 4.5)},  // through, off every edge
  };
  for (const AlignedBox3d& other : others) {
    const AlignedBox3d common = one.intersection(other);
    const double shared = common.isEmpty() ? 0 : common.volume();
    for (const int n : {1, 3}) {
      for (int turn = 0; turn < 3; ++turn) {
        CAPTURE(other.min().transpose(), other.max().transpose(), n, turn);
        std::vector<TriangleMesh> parts{MakeBox(one, 2), MakeBox(other, n)};
        if (turn > 0) {
          const Eigen::Isometry3d motion = RandomMotion(random, 30);
          for (TriangleMesh& part : parts) Move(part, motion);
        }
        TriangleMesh both = parts[0];
        Append(both, parts[1]);
        const SurfaceMesh surface = RepairSurface(both, "x");
        CHECK(surface.report.volume_mm3 ==
              Approx(one.volume() + other.volume() - shared).epsilon(1e-6));
        CheckIsUnionOf(surface, parts, random);
      }
    }
  }
}

TEST_CASE("the union of two spheres has the volume of its two caps") {
  for (const int around : {12, 24, 48}) {
    for (const double distance_mm : {2.0, 5.0, 8.0}) {
      CAPTURE(around, distance_mm);
      constexpr double kRadius = 5;
      TriangleMesh both = MakeSphere({0.1, 0.2, 0.3}, kRadius, around);
      TriangleMesh other = MakeSphere({0, 0, 0}, kRadius, around);
      Eigen::Isometry3d motion(Eigen::AngleAxisd(0.7, Vector3d(1, 2, 3).normalized()));
      motion.pretranslate(Vector3d(0.1, 0.2, 0.3) + distance_mm * Vector3d(0.6, 0.64, 0.48));
      Move(other, motion);
      Append(both, other);
      const SurfaceMesh surface = RepairSurface(both, "x");
      const double ball = 4 * M_PI / 3 * std::pow(kRadius, 3);
      const double height = kRadius - distance_mm / 2;
      const double lens = 2 * M_PI * height * height * (3 * kRadius - height) / 3;
      // A sphere of latitudes and longitudes lacks volume of second order.
      const double share = MakeSphere({0, 0, 0}, kRadius, around).Volume() / ball;
      CHECK(surface.report.volume_mm3 ==
            Approx((2 * ball - lens) * share).epsilon(0.3 * (1 - share) + 1e-3));
      CHECK(surface.report.left_out_mm2 > 0);
    }
  }
}

TEST_CASE("overlapping parts are one lumen, in any position") {
  Random random(7);
  for (int k = 0; k < test::Rounds(40, 5); ++k) {
    CAPTURE(k);
    std::vector<TriangleMesh> parts;
    TriangleMesh all;
    const int count = 2 + k % 4;
    for (int p = 0; p < count; ++p) {
      TriangleMesh part;
      if (random.Uniform(0, 1) < 0.3) {
        part = MakeBox({Vector3d::Zero(), Vector3d(8, 5, 6)}, 1 + k % 3);
      } else if (random.Uniform(0, 1) < 0.5) {
        part = MakeSphere({0, 0, 0}, 3 + 3 * random.Uniform(0, 1), 16);
      } else {
        part =
            MakeTubeMesh(20 + 20 * random.Uniform(0, 1), 1 + k % 7, 16, [](double) { return 3.0; });
        CapTubeMesh(part, 16);
      }
      Move(part, RandomMotion(random, 5));
      parts.push_back(part);
      if (random.Uniform(0, 1) < 0.3) TurnInsideOut(part);
      Append(all, part);
    }
    CheckIsUnionOf(RepairSurface(all, "x"), parts, random);
  }
}

// Tubes of equal radius on one axis, with open or closed ends. Their walls nearly coincide; in a
// file of single precision the match is coarse.
void CheckTubesOnOneAxis(int count, bool open, uint64_t seed) {
  Random random(seed);
  std::vector<TriangleMesh> parts;
  TriangleMesh all;
  for (int p = 0; p < count; ++p) {
    const int around = 8 + 4 * static_cast<int>(random.Uniform(0, 6));
    const int along = 1 + static_cast<int>(random.Uniform(0, 30));
    const double length_mm = 20 + 20 * random.Uniform(0, 1);
    TriangleMesh part = MakeTubeMesh(length_mm, along, around, [](double) { return 3.0; });
    const auto open_faces = static_cast<std::ptrdiff_t>(part.triangles.size());
    CapTubeMesh(part, around);
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.pretranslate(Vector3d(15 * p + random.Uniform(0, 3), 0, 0));
    const bool is_turned = random.Uniform(0, 1) >= 0.5;
    const double turn = is_turned ? random.Uniform(0, 6.28) : 0;
    motion.rotate(Eigen::AngleAxisd(turn, Vector3d::UnitX()));
    Move(part, motion);
    for (Vector3d& v : part.vertices_mm) v = v.cast<float>().cast<double>();
    parts.push_back(part);
    if (open) part.triangles.erase(part.triangles.begin() + open_faces, part.triangles.end());
    Append(all, part);
  }
  CheckIsUnionOf(RepairSurface(all, "x"), parts, random, 2e-3);
}

// Two tubes take a fifth of the time of three.
constexpr int kTubesOnOneAxis = test::kUnderSanitizer ? 2 : 3;

TEST_CASE("vessels of one radius on one axis are one lumen, for any rounding") {
  CheckTubesOnOneAxis(kTubesOnOneAxis, false, 1);
}

TEST_CASE("open vessels of one radius on one axis are one lumen, even if parts must be moved") {
  CheckTubesOnOneAxis(kTubesOnOneAxis, true, 85);
}

TEST_CASE("vessels that cross at small angles leave no wall within") {
  // With this seed, not all pieces meet along whole edges.
  Random random(266);
  std::vector<TriangleMesh> parts;
  TriangleMesh all;
  for (int p = 0; p < 4; ++p) {
    const int around = 8 + 4 * static_cast<int>(random.Uniform(0, 6));
    const double radius_mm = random.Uniform(2, 4);
    const int along = 1 + static_cast<int>(random.Uniform(0, 30));
    const double length_mm = 20 + 20 * random.Uniform(0, 1);
    TriangleMesh part = MakeTubeMesh(length_mm, along, around, [=](double) { return radius_mm; });
    CapTubeMesh(part, around);
    const Vector3d axis = random.Direction();
    Eigen::Isometry3d motion(Eigen::AngleAxisd(random.Uniform(0, 0.3), axis));
    motion.pretranslate(random.InBox(Vector3d::Constant(-2), Vector3d::Constant(2)));
    Move(part, motion);
    parts.push_back(part);
    Append(all, part);
  }
  CheckIsUnionOf(RepairSurface(all, "x"), parts, random);
}

TEST_CASE("a surface is split into triangles that meet in whole edges") {
  Random random(3);
  int crossings = 0;
  for (int k = 0; k < 20; ++k) {
    CAPTURE(k);
    TriangleMesh both = MakeClosedTube(40, 3), other = MakeClosedTube(30, 2 + 0.1 * k);
    Move(other, RandomMotion(random, 3));
    Append(both, other);
    const TriangleMesh split = SplitAtIntersections(TriangleBvh(both), 1e-5).value();
    CHECK(split.Area() == Approx(both.Area()).epsilon(1e-7));
    CHECK(repair::FindEdgeFaults(split).open.empty());
    CHECK(repair::FacesAtUnbalancedEdges(split).empty());
    CHECK(CountCrossings(split) == 0);
    crossings += CountCrossings(both);
  }
  CHECK(crossings > 1000);
}

TEST_CASE("faces that all pass through one another are refused") {
  TriangleMesh soup;
  Random random(17);
  for (int32_t i = 0; i < 3000; i += 3) {
    for (int c = 0; c < 3; ++c) {
      soup.vertices_mm.push_back(random.InBox(Vector3d::Zero(), Vector3d::Constant(50)));
    }
    soup.triangles.push_back({i, i + 1, i + 2});
  }
  CHECK_FALSE(SplitAtIntersections(TriangleBvh(soup), 1e-5));
  CHECK_THROWS_AS(RepairSurface(soup, "soup"), UserError);
}

TEST_CASE("a tube that passes through itself is the union of its turns") {
  // A closed ring wound twice about the same axis, with overlapping turns.
  constexpr double kBend = 20, kRadius = 4;
  constexpr int kAlong = 240, kAround = 20;
  const auto center = [&](double t) {
    const double bend = kBend + 3 * std::cos(t / 2);
    return Vector3d(bend * std::cos(t), bend * std::sin(t), 3 * std::sin(t / 2));
  };
  TriangleMesh ring;
  for (int i = 0; i < kAlong; ++i) {
    const double t = 4 * M_PI * i / kAlong;
    const Vector3d along = (center(t + 1e-4) - center(t - 1e-4)).normalized();
    const Vector3d side = along.cross(Vector3d::UnitZ()).normalized(), up = side.cross(along);
    for (int j = 0; j < kAround; ++j) {
      const double angle = 2 * M_PI * j / kAround;
      ring.vertices_mm.emplace_back(center(t) +
                                    kRadius * (std::cos(angle) * side + std::sin(angle) * up));
    }
  }
  for (int32_t i = 0; i < kAlong; ++i) {
    for (int32_t j = 0; j < kAround; ++j) {
      const int32_t a = i * kAround + j, b = i * kAround + (j + 1) % kAround;
      const int32_t c = (i + 1) % kAlong * kAround + j,
                    d = (i + 1) % kAlong * kAround + (j + 1) % kAround;
      ring.triangles.push_back({a, b, c});
      ring.triangles.push_back({b, d, c});
    }
  }
  const SurfaceMesh surface = RepairSurface(ring, "x");
  CHECK(surface.report.intersections > 100);
  const TriangleBvh bvh(surface.mesh);
  Random random(11);
  int inside = 0;
  for (int k = 0; k < test::Rounds(2000, 4); ++k) {
    const Vector3d at = random.InBox({-30, -30, -9}, {30, 30, 9});
    double nearest = 1e9;
    for (int i = 0; i < 2000; ++i) {
      nearest = std::min(nearest, (at - center(4 * M_PI * i / 2000)).norm());
    }
    if (std::abs(nearest - kRadius) < 0.2) continue;
    CHECK((bvh.Distance(at) > 0) == (nearest < kRadius));
    inside += nearest < kRadius ? 1 : 0;
  }
  CHECK(inside > test::Rounds(200, 4));
}

TEST_CASE("an open branch that ends in the lumen is joined, and its inner end is not an entry") {
  TriangleMesh vessel = MakeTubeMesh(40, 3), branch = MakeTubeMesh(30, 2);
  for (Vector3d& v : branch.vertices_mm) v = Vector3d(20.3 - v.y(), 0.2 + v.x(), v.z());
  const std::vector<TriangleMesh> parts{MakeClosedTube(40, 3), [] {
                                          TriangleMesh closed = MakeClosedTube(30, 2);
                                          for (Vector3d& v : closed.vertices_mm) {
                                            v = Vector3d(20.3 - v.y(), 0.2 + v.x(), v.z());
                                          }
                                          return closed;
                                        }()};
  Append(vessel, branch);
  const SurfaceMesh surface = RepairSurface(vessel, "x");
  Random random(5);
  CheckIsUnionOf(surface, parts, random);
  REQUIRE(surface.report.openings.size() == 3);
  for (const Opening& opening : surface.report.openings) {
    const double far = std::max(
        {-opening.center_mm.x(), opening.center_mm.x() - 40, opening.center_mm.y() - 30.2});
    CHECK(far == Approx(0).margin(0.01));
  }
  // Left out: the branch inside the vessel, from its end to the vessel's wall.
  CHECK(surface.report.left_out_mm2 > 2 * M_PI * 2 * 1.5);
  CHECK(surface.left_out.Area() == Approx(surface.report.left_out_mm2));
  bool is_said = false;
  for (const std::string& finding : surface.report.findings) {
    is_said = is_said || finding.find("within the lumen of another part") != std::string::npos;
  }
  CHECK(is_said);
}

// Heap of tetrahedra at random places in a cube.
TriangleMesh RandomHeap(int32_t bodies, double cube_mm, double body_mm) {
  Random random(5);
  TriangleMesh heap;
  for (int32_t k = 0; k < bodies; ++k) {
    const Vector3d middle = random.InBox({0, 0, 0}, Vector3d::Constant(cube_mm));
    for (int corner = 0; corner < 4; ++corner) {
      heap.vertices_mm.emplace_back(
          middle + random.InBox(Vector3d::Constant(-body_mm), Vector3d::Constant(body_mm)));
    }
    const int32_t a = 4 * k, b = a + 1, c = a + 2, d = a + 3;
    for (const auto& face : {std::array{a, c, b}, {a, b, d}, {a, d, c}, {b, c, d}}) {
      heap.triangles.push_back({face[0], face[1], face[2]});
    }
  }
  return heap;
}

TEST_CASE("a heap of bodies that cross nearly everywhere is refused before it is united") {
  // Dividing the first heap took a minute, uniting the second 25 s.
  for (const TriangleMesh& heap : {RandomHeap(1500, 30, 3), RandomHeap(750, 60, 7)}) {
    CHECK_THROWS_WITH(RepairSurface(heap, "x"), Catch::Contains("nearly everywhere"));
  }
}

}  // namespace
}  // namespace torquer::vessel
