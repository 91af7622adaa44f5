#include "host/simulator/vessel/mesh_check.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <utility>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/mesh_picture.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;

MeshCheck CheckOf(const TriangleMesh& mesh, double units_per_mm = 1) {
  const test::TemporaryFolder folder;
  WriteObj(folder.Path("a.obj"), mesh, units_per_mm);
  return CheckMesh(test::Contents(folder.Path("a.obj")), "a.obj");
}

TEST_CASE("a surface's faults are counted, and its unit is guessed") {
  const MeshCheck tube = CheckOf(MakeTubeMesh());
  CHECK(tube.unit == MeshUnit::kMillimeter);
  CHECK(tube.components == 1);
  CHECK(tube.edges.open.size() == 48);  // 24 at each end
  CHECK(tube.edges.several.empty());
  CHECK(tube.edges.disagreeing == 0);
  CHECK(CheckOf(MakeTubeMesh(), 0.001).unit == MeshUnit::kMeter);
  CHECK(CheckOf(MakeTubeMesh(), 1000).unit == MeshUnit::kMicrometer);
  const MeshCheck huge = CheckOf(MakeTubeMesh(), 1e-6);
  CHECK_FALSE(huge.unit);
  CHECK_THAT(huge.refusal, Contains("not the size of a vessel"));
  CHECK_THAT(DescribeCheck(huge), Contains("not the size of a vessel in any unit"));
  // In nm the surface also lies far from the origin, but to move it there would not help.
  CHECK_THAT(CheckOf(MakeTubeMesh(), 1e6).refusal,
             Contains("not the size of a vessel") && Contains("scale it to millimeters"));

  TriangleMesh bad = MakeClosedTube();
  std::swap(bad.triangles[100][0], bad.triangles[100][1]);
  Append(bad, MakeTubeMesh(40, 1));
  const MeshCheck check = CheckOf(bad);
  CHECK(check.components == 2);
  CHECK(check.edges.open.size() == 48);
  CHECK(check.edges.disagreeing == 3);
  bad.triangles.push_back({30, 31, 200});
  CHECK(CheckOf(bad).edges.several.size() == 1);
}

TEST_CASE(
    "an instrument is proposed to enter at each open end, in the middle and along the vessel") {
  const MeshCheck check = CheckOf(MakeTubeMesh());
  REQUIRE(check.entries.size() == 2);
  for (const EntryProposal& entry : check.entries) {
    CHECK(entry.room_mm > 2.5);
    CHECK(std::hypot(entry.point_mm.y(), entry.point_mm.z()) < 0.3);
    CHECK(entry.direction.x() * (20 - entry.point_mm.x()) > 0);
    CHECK(std::abs(entry.direction.x()) == Approx(1).margin(0.01));
  }
}

TEST_CASE("a closed surface is entered behind its flat ends, or else at its widest place") {
  TriangleMesh tube = MakeTubeMesh(40, 20, 24, [](double x) { return 2 + 2 * std::sin(x / 14); });
  CapTubeMesh(tube);
  const MeshCheck closed = CheckOf(tube);
  REQUIRE(closed.entries.size() == 2);
  for (const EntryProposal& entry : closed.entries) {
    CHECK(std::min(entry.point_mm.x(), 40 - entry.point_mm.x()) < 8);
    CHECK(entry.direction.x() * (20 - entry.point_mm.x()) > 0.99);
  }
  CHECK_THAT(ProposeScene(closed), Contains("behind a flat end"));
  // A round end has no flat part, and no panel of its wall is an end.
  TriangleMesh round = MakeTubeMesh(40, 40, 24, [](double x) {
    return 4 * std::sqrt(std::max(1e-6, 1 - std::pow(x / 20 - 1, 2)));
  });
  CapTubeMesh(round);
  const MeshCheck widest = CheckOf(round);
  REQUIRE(widest.entries.size() == 1);
  CHECK(widest.entries[0].room_mm > 3.5);
  CHECK(std::abs(widest.entries[0].direction.x()) > 0.9);
  CHECK_THAT(ProposeScene(widest), Contains("the widest place"));
}

// The same surface with own vertices for each triangle.
TriangleMesh Apart(const TriangleMesh& mesh) {
  TriangleMesh apart;
  for (const auto& triangle : mesh.triangles) {
    const auto first = static_cast<int32_t>(apart.vertices_mm.size());
    for (const int32_t vertex : triangle) apart.vertices_mm.push_back(mesh.vertices_mm[vertex]);
    apart.triangles.push_back({first, first + 1, first + 2});
  }
  return apart;
}

TEST_CASE("a shipped surface has the same few entries in any unit, with shared vertices or not") {
  const auto& [file, unit, entries] = GENERATE(
      table<std::string, MeshUnit, size_t>({{"neuro_arch/surface.obj", MeshUnit::kMillimeter, 1},
                                            {"abdominal_aorta/surface.stl", MeshUnit::kMeter, 6}}));
  const std::string path = test::SourcePath("/host/scenes/meshes/" + file);
  const TriangleMesh mesh = ImportMesh(test::Contents(path), path, UnitOf(unit).mm);
  const MeshCheck first = CheckOf(mesh);
  REQUIRE(first.entries.size() == entries);
  // All faces of the coarse neuro_arch meet at sharp edges, as ends do.
  CHECK((first.doubtful_ends > 0) == (entries == 1));
  CHECK((DescribeCheck(first).find("look like ends") != std::string::npos) == (entries == 1));
  for (const double units_per_mm : {1000.0, 1.0, 0.001}) {
    for (const TriangleMesh& same : {mesh, Apart(mesh)}) {
      CAPTURE(units_per_mm, same.vertices_mm.size());
      const MeshCheck check = CheckOf(same, units_per_mm);
      CHECK(check.doubtful_ends == first.doubtful_ends);
      REQUIRE(check.entries.size() == entries);
      for (size_t k = 0; k < entries; ++k) {
        CHECK((check.entries[k].point_mm - first.entries[k].point_mm).norm() < 0.2);
        CHECK((check.entries[k].direction - first.entries[k].direction).norm() < 0.01);
      }
    }
  }
}

TEST_CASE("neither a file's name nor a surface far away does harm") {
  const MeshCheck named = CheckMesh("", "\033[2J<b>.stl");
  CHECK_FALSE(named.surface);
  CHECK(DescribeCheck(named).find('\033') == std::string::npos);
  CHECK(DrawCheck(named).empty());
  CHECK(ProposeScene(named).empty());
  TriangleMesh off = MakeTubeMesh();
  for (Eigen::Vector3d& vertex : off.vertices_mm) vertex.y() += 2e6;
  CHECK_THAT(CheckOf(off).refusal, Contains("move it to the origin"));
}

}  // namespace
}  // namespace torquer::vessel
