// Samples of a surface: area, shares, and patterns in the order of its faces.
#include "host/simulator/vessel/face_sample.h"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdint>
#include <vector>

#include "host/simulator/vessel/surface_mesh.h"
#include "tests/support/made_meshes.h"

namespace torquer::vessel {
namespace {

// Triangles beside each other, of these areas.
TriangleMesh Triangles(const std::vector<double>& areas_mm2) {
  TriangleMesh mesh;
  for (const double area_mm2 : areas_mm2) {
    const auto at = static_cast<std::int32_t>(mesh.vertices_mm.size());
    mesh.vertices_mm.insert(mesh.vertices_mm.end(), {{0, 0, 0}, {2, 0, 0}, {0, area_mm2, 0}});
    mesh.triangles.push_back({at, at + 1, at + 2});
  }
  return mesh;
}

TEST_CASE("a small surface is its own sample, each face for its area") {
  const auto sample = SampleFaces(Triangles({1, 0, 3}), 3);
  REQUIRE(sample.size() == 3);
  CHECK(sample[1].weight_mm2 == 0);
  CHECK(sample[2].weight_mm2 == 3);
}

TEST_CASE("a sample stands for the area, whatever alternates in the order of the faces") {
  const int period = GENERATE(2, 3, 4, 5, 8, 10, 16);
  CAPTURE(period);
  std::vector<double> areas(16000, 1.0);
  const TriangleMesh mesh = Triangles(areas);
  double total = 0, first = 0;
  for (const auto& [face, weight_mm2] : SampleFaces(mesh, 1000)) {
    total += weight_mm2;
    if (static_cast<int>(face) % period == 0) first += weight_mm2;
  }
  CHECK(total == Approx(16000));
  const double share = 1.0 / period;
  // Four standard deviations of 1000 independent draws.
  CHECK(std::abs(first / total - share) < 4 * std::sqrt(share * (1 - share) / 1000));
}

TEST_CASE("a large face counts by its area, and a face without area never") {
  std::vector<double> areas(2000, 1.0);
  areas[700] = 2000;
  areas[900] = 0;
  double large = 0, total = 0;
  for (const auto& [face, weight_mm2] : SampleFaces(Triangles(areas), 500)) {
    total += weight_mm2;
    if (face == 700) large += weight_mm2;
    CHECK(face != 900);
  }
  CHECK(large / total == Approx(2000.0 / 3998).margin(0.01));
}

TEST_CASE("a part of the faces has its own sample") {
  const TriangleMesh mesh = Triangles({1, 2, 3, 4});
  const std::vector<std::int32_t> part = {3, 1};
  const auto sample = SampleFaces(mesh, part, 5);
  REQUIRE(sample.size() == 2);
  CHECK(sample[0].face == 3);
  CHECK(sample[1].weight_mm2 == 2);
}

TEST_CASE("a wall with thickness is found in any order of its triangles") {
  // Writers of files alternate between the two sides of a wall in groups of any size.
  const auto [rows, group] = GENERATE(table<int, std::ptrdiff_t>({{18, 2}, {26, 3}, {35, 4}}));
  CAPTURE(rows, group);
  TriangleMesh shell = MakeShell(60, 4, 6, rows);
  const std::ptrdiff_t side = 2 * 24 * rows;
  const auto outer = shell.triangles.begin();
  std::vector<std::array<std::int32_t, 3>> alternating;
  for (std::ptrdiff_t at = 0; at < side; at += group) {
    alternating.insert(alternating.end(), outer + at, outer + at + group);
    alternating.insert(alternating.end(), outer + side + at, outer + side + at + group);
  }
  std::copy(alternating.begin(), alternating.end(), outer);
  const SurfaceMesh surface = RepairSurface(shell, "x");
  CHECK(surface.report.was_shell);
  CHECK(surface.report.width_mm[1] == Approx(2 * 4).epsilon(0.02));
}

}  // namespace
}  // namespace torquer::vessel
