// Surfaces with small shares, sheets and membranes: what encloses nothing is left out or refused.
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_repair.h"
#include "host/simulator/vessel/surface_mesh.h"
#include "host/support/error.h"
#include "tests/support/allocation_counter.h"
#include "tests/support/made_meshes.h"
#include "tests/vessel/field_checks.h"
#include "tests/vessel/union_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::AlignedBox3d;
using Eigen::Vector3d;

TEST_CASE("a fraction too small to print is not reported") {
  // A corner of one box reaches into another one by less and less.
  const AlignedBox3d one(Vector3d(0, 0, 0), Vector3d(10, 6, 4));
  bool is_ever_said = false;
  for (const double deep_mm : {1.0, 0.1, 0.03, 0.01, 0.003, 0.001}) {
    const AlignedBox3d other(Vector3d(10 - deep_mm, 6 - deep_mm, 4 - deep_mm),
                             Vector3d(16, 12, 10));
    TriangleMesh both = MakeBox(one, 2);
    Append(both, MakeBox(other, 3));
    for (const std::string& finding : RepairSurface(both, "x").report.findings) {
      INFO(deep_mm << " mm: " << finding);
      CHECK(finding.find("e-") == std::string::npos);
      is_ever_said = is_ever_said || finding.find("lay within the lumen") != std::string::npos;
    }
  }
  CHECK(is_ever_said);
}

TEST_CASE("a membrane across the lumen and a fin are removed as sheets") {
  TriangleMesh tube = MakeClosedTube();
  SECTION("membrane") {
    // A disk across the middle: the edges of its rim have three faces.
    const auto middle = static_cast<int32_t>(tube.vertices_mm.size());
    tube.vertices_mm.emplace_back(20, 0, 0);
    for (int32_t j = 0; j < 24; ++j) {
      tube.triangles.push_back({240 + j, 240 + (j + 1) % 24, middle});
    }
  }
  SECTION("fins, one inside and one outside") {
    for (const double height : {1.5, 6.0}) {
      const auto first = static_cast<int32_t>(tube.vertices_mm.size());
      for (int i = 0; i <= 20; ++i) tube.vertices_mm.emplace_back(2 * i, height, 0.1);
      for (int32_t i = 4; i < 16; ++i) {
        tube.triangles.push_back({24 * i, 24 * (i + 1), first + i});
        tube.triangles.push_back({24 * (i + 1), first + i + 1, first + i});
      }
    }
  }
  SECTION("a loose disk") {
    const auto first = static_cast<int32_t>(tube.vertices_mm.size());
    for (int32_t j = 0; j < 24; ++j) {
      tube.vertices_mm.emplace_back(10 + 5 * std::cos(j * M_PI / 12), 5 * std::sin(j * M_PI / 12),
                                    9);
    }
    for (int32_t j = 1; j < 23; ++j) tube.triangles.push_back({first, first + j, first + j + 1});
  }
  const SurfaceMesh surface = RepairSurface(tube, "x");
  Random random(9);
  CheckIsUnionOf(surface, {MakeClosedTube()}, random);
  CHECK(surface.report.openings.empty());
  CHECK(surface.report.volume_mm3 == Approx(MakeClosedTube().Volume()).epsilon(1e-6));
}

TEST_CASE("two bubbles with a common membrane are one lumen") {
  // Two boxes with a common side that exists once, and one box far away.
  for (const bool turned : {false, true}) {
    const AlignedBox3d one(Vector3d(-90, 0, 0), Vector3d(10, 6, 4));
    const AlignedBox3d two(Vector3d(10, 0, 0), Vector3d(13, 6, 4));
    const AlignedBox3d far(Vector3d(300, 0, 0), Vector3d(310, 6, 4));
    TriangleMesh all = MakeBox(far, 2), other = MakeBox(two, 4);
    if (turned) TurnInsideOut(other);
    std::erase_if(other.triangles, [&](const auto& t) {
      return std::all_of(t.begin(), t.end(),
                         [&](int32_t v) { return other.vertices_mm[v].x() < 10.001; });
    });
    Append(all, MakeBox(one, 4));
    Append(all, other);
    Random random(13);
    const SurfaceMesh surface = RepairSurface(all, "x");
    CHECK(surface.report.volume_mm3 == Approx((103 + 10) * 6 * 4).epsilon(1e-6));
    CheckIsUnionOf(surface, {MakeBox({one.min(), two.max()}, 1), MakeBox(far, 1)}, random);
  }
}

TEST_CASE("a surface that is mostly sheets is refused, and not reduced to a small lumen") {
  // A small closed tube with a fin that is many times larger.
  TriangleMesh tube = MakeClosedTube(20, 1);
  const auto first = static_cast<int32_t>(tube.vertices_mm.size());
  for (int i = 0; i <= 20; ++i) tube.vertices_mm.emplace_back(i, 40, 0);
  for (int32_t i = 0; i < 20; ++i) {
    tube.triangles.push_back({24 * i, 24 * (i + 1), first + i});
    tube.triangles.push_back({24 * (i + 1), first + i + 1, first + i});
  }
  CHECK_THROWS_WITH(RepairSurface(tube, "sheets.stl"),
                    Contains("sheets.stl: ") && Contains("% of the surface encloses nothing"));
}

TEST_CASE("a surface that is inside out beyond a crossing is refused, with the place") {
  // A tube whose cross section is a figure eight with unequal loops.
  TriangleMesh eight = MakeTubeMesh(40, 20, 48, [](double) { return 1.0; });
  for (size_t i = 0; i < eight.vertices_mm.size(); ++i) {
    const double angle = 2 * M_PI * (static_cast<double>(i % 48) + 0.3) / 48;
    Vector3d& v = eight.vertices_mm[i];
    v.y() = 6 * std::sin(angle) * (1 + 0.4 * std::sin(angle));
    v.z() = 3 * std::sin(2 * angle);
  }
  CapTubeMesh(eight, 48);
  CHECK_THROWS_AS(RepairSurface(eight, "eight.stl"), UserError);
  CHECK_THROWS_WITH(RepairSurface(eight, "eight.stl"),
                    Contains("eight.stl: ") && Contains("inside out") &&
                        Contains("for instance at (") && Contains("repair"));
}

// Closed tube whose vertices are displaced at random, by up to noise_mm along each axis.
TriangleMesh NoisyTube(double noise_mm) {
  TriangleMesh tube = MakeTubeMesh(20, 40, 48, [](double) { return 3.0; });
  CapTubeMesh(tube, 48);
  Random random(31);
  const Vector3d reach = Vector3d::Constant(noise_mm);
  for (Vector3d& v : tube.vertices_mm) v += random.InBox(-reach, reach);
  return tube;
}

bool Says(const SurfaceMesh& surface, const std::string& words) {
  return std::any_of(
      surface.report.findings.begin(), surface.report.findings.end(),
      [&](const std::string& finding) { return finding.find(words) != std::string::npos; });
}

TEST_CASE("the folds of a noisy wall stay left out if a fin stands on it") {
  // Folds that are turned outward unbalance edges, so that pieces of the wall look like sheets.
  TriangleMesh tube = NoisyTube(0.3);
  const double alone_mm3 = RepairSurface(tube, "x").report.volume_mm3;
  const auto first = static_cast<int32_t>(tube.vertices_mm.size());
  for (int i = 0; i <= 40; ++i) tube.vertices_mm.emplace_back(0.5 * i, 6, 0.1);
  for (int32_t i = 8; i < 32; ++i) {
    tube.triangles.push_back({48 * i, 48 * (i + 1), first + i});
    tube.triangles.push_back({48 * (i + 1), first + i + 1, first + i});
  }
  const SurfaceMesh surface = RepairSurface(tube, "x");
  for (const std::string& finding : surface.report.findings) UNSCOPED_INFO(finding);
  // The wall's folds divide the fin.
  CHECK(Says(surface, "5 sheets that enclose nothing"));
  CHECK(Says(surface, "folded over and inside out"));
  CHECK(surface.report.volume_mm3 == Approx(alone_mm3).epsilon(1e-3));
}

TEST_CASE("a wall of too much noise is refused before it is divided") {
  const TriangleMesh tube = NoisyTube(0.65);
  const size_t before = test::AllocationCount();
  CHECK_THROWS_WITH(RepairSurface(tube, "x"), Contains("inside out"));
  const size_t allocations = test::AllocationCount() - before;
  CAPTURE(allocations);
  CHECK(allocations < 10 * tube.triangles.size());
}

}  // namespace
}  // namespace torquer::vessel
