#include "host/simulator/vessel/surface_mesh.h"

#include <filesystem>
#include <fstream>
#include <utility>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_import.h"
#include "host/simulator/vessel/triangle_bvh.h"
#include "host/support/error.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::Vector3d;
using test::TemporaryFolder;

std::string Said(const MeshReport& report) {
  std::string all;
  for (const std::string& finding : report.findings) all += finding + "\n";
  return all;
}

void CheckIsTube(const SurfaceMesh& surface, double length_mm, double radius_mm) {
  const TriangleBvh bvh(surface.mesh);
  for (const double x : Steps(radius_mm + 1, length_mm - radius_mm, 1.7)) {
    CHECK(bvh.Distance({x, 0, 0}) == Approx(radius_mm * std::cos(M_PI / 24)).margin(0.02));
    CHECK(bvh.Distance({x, 0, 2 * radius_mm}) == Approx(-radius_mm).margin(0.02));
  }
  CHECK(bvh.Distance({-2, 0, 0}) == Approx(-2).margin(0.02));
  CHECK(surface.report.volume_mm3 ==
        Approx(M_PI * radius_mm * radius_mm * length_mm).epsilon(0.03));
}

TEST_CASE("STL, OBJ and PLY give the same closed tube") {
  const TemporaryFolder folder;
  const TriangleMesh tube = MakeClosedTube();
  WriteObj(folder.Path("a.obj"), tube);
  WritePly(folder.Path("a.ply"), tube);
  WriteBinaryStl(folder.Path("a.STL"), tube);
  for (const char* name : {"a.obj", "a.ply", "a.STL"}) {
    const SurfaceMesh surface = ReadSurface(folder.Path(name), MeshUnit::kMillimeter);
    CHECK(surface.mesh.triangles.size() == tube.triangles.size());
    CHECK(surface.mesh.vertices_mm.size() == tube.vertices_mm.size());
    CHECK(surface.report.openings.empty());
    CHECK_FALSE(surface.report.was_inward);
    CheckIsTube(surface, 40, 3);
  }
}

TEST_CASE("inward normals are turned, and reported") {
  TriangleMesh tube = MakeClosedTube();
  TurnInsideOut(tube);
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.was_inward);
  CHECK_THAT(Said(surface.report), Contains("normals pointed into the lumen"));
  CheckIsTube(surface, 40, 3);
}

TEST_CASE("faces oriented against their neighbors are turned, and reported") {
  TriangleMesh tube = MakeClosedTube();
  for (size_t i = 0; i < tube.triangles.size(); i += 7) {
    std::swap(tube.triangles[i][0], tube.triangles[i][1]);
  }
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.triangles_turned == (tube.triangles.size() + 6) / 7);
  CHECK_THAT(Said(surface.report), Contains("oriented against"));
  CheckIsTube(surface, 40, 3);
}

TEST_CASE("open ends are closed and listed as the natural entries") {
  const SurfaceMesh surface = RepairSurface(MakeTubeMesh(), "x");
  CheckIsTube(surface, 40, 3);
  REQUIRE(surface.report.openings.size() == 2);
  for (const Opening& opening : surface.report.openings) {
    const bool at_start = opening.center_mm.x() < 20;
    CHECK((opening.center_mm - Vector3d(at_start ? 0 : 40, 0, 0)).norm() < 1e-6);
    CHECK((opening.outward - Vector3d(at_start ? -1 : 1, 0, 0)).norm() < 1e-6);
    CHECK(opening.radius_mm == Approx(3).epsilon(0.02));
  }
  CHECK_THAT(Said(surface.report), Contains("Open end of radius") && Contains("(40.0, "));
}

TEST_CASE("open ends of a surface with inward normals lead into the vessel, too") {
  TriangleMesh inward = MakeTubeMesh(), across = MakeTubeMesh();
  TurnInsideOut(inward);
  for (Vector3d& v : across.vertices_mm) v = Vector3d(20 - v.y(), v.x() - 20, v.z());
  TriangleMesh cross = inward;
  Append(cross, across);
  for (const auto& [mesh, ends] : {std::pair(inward, 2), std::pair(cross, 4)}) {
    const SurfaceMesh surface = RepairSurface(mesh, "x");
    CHECK(surface.report.openings.size() == static_cast<size_t>(ends));
    for (const Opening& opening : surface.report.openings) {
      const Vector3d outward = (opening.center_mm - Vector3d(20, 0, 0)) / 20;
      CHECK((opening.outward - outward).norm() < 1e-3);
      CHECK((opening.inward + outward).norm() < 1e-2);
    }
  }
}

TEST_CASE("a small hole in the wall is closed, and reported") {
  TriangleMesh tube = MakeTubeMesh(40, 60, 48, [](double) { return 3.0; });
  tube.triangles.erase(tube.triangles.begin() + 2500);
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.holes_closed == 1);
  CHECK(surface.report.openings.size() == 2);
  CHECK_THAT(Said(surface.report), Contains("1 hole in the wall closed"));
}

TEST_CASE("a face missing in a coarse wall is a hole, not an end of the vessel") {
  TriangleMesh tube = MakeTubeMesh(40, 10, 8, [](double) { return 3.0; });
  tube.triangles.erase(tube.triangles.begin() + 71);
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.holes_closed == 1);
  CHECK(surface.report.openings.size() == 2);
}

TEST_CASE("a narrow slit is closed, a surface of single faces is refused") {
  TriangleMesh tube = MakeTubeMesh(40, 60, 48, [](double) { return 3.0; });
  // Two rows of faces separated by 0.05 mm.
  const auto first = static_cast<int32_t>(tube.vertices_mm.size());
  for (int32_t i = 21; i < 29; ++i) {
    tube.vertices_mm.emplace_back(tube.vertices_mm[i * 48] - Vector3d(0, 0.01, 0.05));
  }
  for (auto& triangle : tube.triangles) {
    const bool is_beyond =
        std::any_of(triangle.begin(), triangle.end(), [](int32_t v) { return v % 48 > 40; });
    for (int32_t& v : triangle) {
      if (is_beyond && v % 48 == 0 && v / 48 >= 21 && v / 48 < 29) v = first + v / 48 - 21;
    }
  }
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.holes_closed == 1);
  CHECK(surface.report.openings.size() == 2);
  CheckIsTube(surface, 40, 3);

  const TriangleMesh whole = MakeClosedTube();
  TriangleMesh single;
  for (size_t i = 0; i < whole.triangles.size(); ++i) {
    const auto corner = static_cast<int32_t>(single.vertices_mm.size());
    for (int c = 0; c < 3; ++c) {
      single.vertices_mm.emplace_back(0.9 * whole.Corner(i, c) + 0.1 * whole.Centroid(i));
    }
    single.triangles.push_back({corner, corner + 1, corner + 2});
  }
  CHECK_THROWS_WITH(RepairSurface(single, "single.stl"),
                    Contains("single.stl: ") && Contains("export it again"));
}

TEST_CASE("a surface with half of a vessel missing is refused, with the place") {
  TriangleMesh tube = MakeTubeMesh();
  TriangleMesh half;
  half.vertices_mm = tube.vertices_mm;
  for (size_t i = 0; i < tube.triangles.size(); ++i) {
    const Vector3d at = tube.Centroid(i);
    if (at.x() < 10 || at.x() > 30 || at.y() > 0) half.triangles.push_back(tube.triangles[i]);
  }
  CHECK_THROWS_WITH(RepairSurface(half, "file.obj"), Contains("file.obj") && Contains("rim") &&
                                                         Contains("(20.0,") && Contains("fill"));
}

TEST_CASE("meters are neither guessed nor passed over") {
  const TemporaryFolder folder;
  const TriangleMesh tube = MakeClosedTube();
  WriteObj(folder.Path("meters.obj"), tube, 1e-3);
  WriteObj(folder.Path("millimeters.obj"), tube);
  CHECK_THROWS_WITH(ReadSurface(folder.Path("meters.obj"), MeshUnit::kMillimeter),
                    Contains("meters.obj") && Contains("mesh_unit = \"m\""));
  CHECK_THROWS_WITH(ReadSurface(folder.Path("millimeters.obj"), MeshUnit::kMeter),
                    Contains("mesh_unit = \"mm\""));
  CheckIsTube(ReadSurface(folder.Path("meters.obj"), MeshUnit::kMeter), 40, 3);
  for (const auto& [unit, mm] :
       {std::pair(MeshUnit::kCentimeter, 10.0), std::pair(MeshUnit::kMicrometer, 0.001),
        std::pair(MeshUnit::kInch, 25.4)}) {
    WriteObj(folder.Path("other.obj"), tube, 1 / mm);
    CheckIsTube(ReadSurface(folder.Path("other.obj"), unit), 40, 3);
  }
  // The advice names each unit that would load, and none that would not.
  WriteObj(folder.Path("small.obj"), tube, 0.1);
  CHECK_THROWS_WITH(ReadSurface(folder.Path("small.obj"), MeshUnit::kMillimeter),
                    Contains("\"cm\" if that is 40 x 6 x 6 mm, or \"in\" if that is 101.6 x") &&
                        !Contains("\"m\""));
  WriteObj(folder.Path("micrometers.obj"), tube, 1000);
  CHECK_THROWS_WITH(ReadSurface(folder.Path("micrometers.obj"), MeshUnit::kMillimeter),
                    Contains("mesh_unit = \"um\" if that is 40 x 6 x 6 mm") && !Contains("\"mm\""));
}

TEST_CASE("fragments hanging on by an edge of three faces are left out, and reported") {
  TriangleMesh tube = MakeClosedTube();
  const auto fin = static_cast<int32_t>(tube.vertices_mm.size());
  const auto& triangle = tube.triangles[100];
  tube.vertices_mm.emplace_back(tube.vertices_mm[triangle[0]] + Vector3d(0.3, 0.3, 0));
  tube.triangles.push_back({triangle[0], triangle[1], fin});
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.triangles_dropped == 1);
  CHECK_THAT(Said(surface.report), Contains("fragment (1 triangle"));
  CheckIsTube(surface, 40, 3);
}

TEST_CASE("two vessels that touch along an edge are kept, distinguished by the winding number") {
  TriangleMesh tube = MakeClosedTube();
  TriangleMesh other = MakeClosedTube();
  // The second tube lies beside the first and shares the edges of one line of vertices.
  for (Vector3d& v : other.vertices_mm) v.y() = 6 - v.y();
  TurnInsideOut(other);
  Append(tube, other);
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.crossed_edges == 20);
  CHECK_THAT(Said(surface.report), Contains("four or more faces"));
  const TriangleBvh bvh(surface.mesh);
  CHECK(bvh.Distance({20, 0, 0}) > 2.9);
  CHECK(bvh.Distance({20, 6, 0}) > 2.9);
  CHECK(bvh.Distance({20, 3, 0.5}) < 0);
  CHECK(bvh.Distance({20, 3, -0.2}) < 0);
  CHECK(bvh.Distance({20, 2.9, 0}) > 0);
  CHECK(bvh.Distance({20, 3.1, 0}) > 0);
}

TEST_CASE("slivers are repaired, and reported") {
  TriangleMesh tube = MakeClosedTube();
  // A vertex in the middle of an edge. One side is split there, the other is not, and a flat
  // triangle lies between them.
  const auto triangle = tube.triangles[200];
  const auto middle = static_cast<int32_t>(tube.vertices_mm.size());
  tube.vertices_mm.emplace_back((tube.vertices_mm[triangle[0]] + tube.vertices_mm[triangle[1]]) /
                                2);
  tube.triangles[200] = {triangle[0], middle, triangle[2]};
  tube.triangles.push_back({middle, triangle[1], triangle[2]});
  tube.triangles.push_back({triangle[1], middle, triangle[0]});
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.slivers_repaired == 1);
  CHECK_THAT(Said(surface.report), Contains("sliver repaired"));
  CheckIsTube(surface, 40, 3);
  const TriangleBvh bvh(surface.mesh);
  for (size_t i = 0; i < surface.mesh.triangles.size(); ++i) {
    CHECK(surface.mesh.DoubleArea(i).norm() > 1e-3);
  }
}

TEST_CASE("doubled and flat triangles are left out, and reported") {
  TriangleMesh tube = MakeClosedTube();
  tube.triangles.push_back(tube.triangles[5]);
  tube.triangles.push_back({3, 3, 7});
  const SurfaceMesh surface = RepairSurface(tube, "x");
  CHECK(surface.report.triangles_dropped == 2);
  CheckIsTube(surface, 40, 3);
}

TEST_CASE("a flat sheet is refused, because it encloses no volume") {
  TriangleMesh sheet;
  sheet.vertices_mm = {{0, 0, 0}, {9, 0, 0}, {0, 9, 0}, {9, 9, 0}};
  sheet.triangles = {{0, 1, 2}};
  CHECK_THROWS_WITH(RepairSurface(sheet, "x"), Contains("x: the surface encloses no volume"));
  sheet.triangles.push_back({1, 3, 2});
  CHECK_THROWS_WITH(RepairSurface(sheet, "x"), Contains("x: the surface encloses no volume"));
}

TEST_CASE("a one-sided surface is refused") {
  // Moebius band of 40 steps, 5 mm wide on a circle of 30 mm.
  TriangleMesh band;
  for (int i = 0; i < 40; ++i) {
    const double turn = 2 * M_PI * i / 40;
    const Vector3d out(std::cos(turn), std::sin(turn), 0);
    const Vector3d across = 5 * (std::cos(turn / 2) * out + std::sin(turn / 2) * Vector3d::UnitZ());
    band.vertices_mm.emplace_back(30 * out - across);
    band.vertices_mm.emplace_back(30 * out + across);
  }
  for (int32_t i = 0; i < 40; ++i) {
    const int32_t a = 2 * i, b = a + 1, c = i == 39 ? 1 : a + 2, d = i == 39 ? 0 : a + 3;
    band.triangles.push_back({a, b, c});
    band.triangles.push_back({b, d, c});
  }
  CHECK_THROWS_WITH(RepairSurface(band, "band"), Contains("one side only"));
}

TEST_CASE("a wall with thickness is turned into its lumen, and reported") {
  const SurfaceMesh surface = RepairSurface(MakeShell(), "x");
  CHECK(surface.report.was_shell);
  CHECK_THAT(Said(surface.report), Contains("wall with thickness"));
  CheckIsTube(surface, 60, 4);
  CHECK(surface.report.openings.size() == 2);
}

TEST_CASE("a ragged rim that taking the inner side leaves is closed, and reported") {
  TriangleMesh shell = MakeShell(100);
  for (Vector3d& v : shell.vertices_mm) {
    const double angle = std::atan2(v.z(), v.y());
    if (v.x() < 1e-6) v.x() = 2.5 * std::cos(2 * angle) - 4;
  }
  const SurfaceMesh surface = RepairSurface(shell, "x");
  CHECK(surface.report.was_shell);
  CHECK(surface.report.holes_closed == 1);
  CHECK(surface.report.openings.size() == 1);
  const TriangleBvh bvh(surface.mesh);
  for (double x = 5; x < 95; x += 5) {
    CHECK(bvh.Distance({x, 0, 0}) == Approx(4 * std::cos(M_PI / 24)).margin(0.02));
    CHECK(bvh.Distance({x, 0, 5}) < -0.9);
  }
}

TEST_CASE("a lumen is not taken for a wall") {
  const SurfaceMesh surface = RepairSurface(MakeClosedTube(100, 3), "x");
  CHECK_FALSE(surface.report.was_shell);
  CHECK(surface.report.tube_facing_share < 0.01);
}

TEST_CASE("a bundle of separate tubes is a lumen and no wall with thickness") {
  // Nearly all rays from a tube in the middle meet the tubes beside it.
  TriangleMesh bundle;
  for (int row = 0; row < 6; ++row) {
    for (int column = 0; column < 6; ++column) {
      TriangleMesh tube = MakeTubeMesh(40, 8, 24, [](double) { return 3; });
      CapTubeMesh(tube);
      for (Vector3d& v : tube.vertices_mm)
        v += Vector3d(0, 6.4 * column + 3.2 * (row % 2), 5.6 * row);
      Append(bundle, tube);
    }
  }
  const SurfaceMesh surface = RepairSurface(bundle, "x");
  CHECK_FALSE(surface.report.was_shell);
  CHECK(surface.report.volume_mm3 == Approx(36 * 40 * 24 * 4.5 * std::sin(M_PI / 12)));
}

TEST_CASE(
    "a part within another is removed, a nick in the wall is included, and both are reported") {
  TriangleMesh tube = MakeClosedTube(40, 6);
  TriangleMesh core = MakeClosedTube(30, 0.4);
  for (Vector3d& v : core.vertices_mm) v.x() += 5;
  Append(tube, core);
  const SurfaceMesh plain = RepairSurface(tube, "x");
  CHECK_THAT(Said(plain.report), Contains("lay within the lumen of another part"));
  CheckIsTube(plain, 40, 6);

  TriangleMesh nicked = MakeTubeMesh(40, 40, 40, [](double) { return 3.0; });
  CapTubeMesh(nicked, 40);
  // A spike from one side, pushed out through the opposite wall.
  nicked.vertices_mm[20 * 40 + 5] = 1.2 * nicked.vertices_mm[20 * 40 + 25];
  const SurfaceMesh surface = RepairSurface(nicked, "x");
  CHECK(surface.report.intersections > 0);
  CHECK_THAT(Said(surface.report), Contains("of faces intersect"));
  const TriangleBvh bvh(surface.mesh);
  CHECK(bvh.Distance({10, 0, 0}) > 2.9);
  CHECK(bvh.Distance({30, 0, 0}) > 2.9);
}

TEST_CASE("files without a usable surface are refused by name, with the remedy") {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& name) {
    return ReadSurface(folder.Path(name), MeshUnit::kMillimeter);
  };
  const auto refused = [&](const std::string& name, const std::string& part) {
    INFO(name);
    CHECK_THROWS_AS(read(name), UserError);
    CHECK_THROWS_WITH(read(name), Contains(name) && Contains(part));
  };
  refused("missing.stl", "No such file or directory");
  std::filesystem::create_directory(folder.Path("folder.stl"));
  refused("folder.stl", "cannot be read");
  std::ofstream(folder.Path("model.step")) << "x";
  refused("model.step", ".stl, .obj or .ply");
  std::ofstream(folder.Path("empty.stl")).flush();
  refused("empty.stl", "export");
  std::ofstream(folder.Path("empty.obj")).flush();
  refused("empty.obj", "export");
  std::ofstream(folder.Path("words.ply")) << "these are not the triangles you are looking for";
  refused("words.ply", "export");
  std::ofstream(folder.Path("points.obj")) << "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  refused("points.obj", "export");

  WriteBinaryStl(folder.Path("cut.stl"), MakeClosedTube());
  std::filesystem::resize_file(folder.Path("cut.stl"),
                               std::filesystem::file_size(folder.Path("cut.stl")) * 2 / 3);
  refused("cut.stl", "export it again");
  WritePly(folder.Path("cut.ply"), MakeClosedTube());
  std::filesystem::resize_file(folder.Path("cut.ply"),
                               std::filesystem::file_size(folder.Path("cut.ply")) * 2 / 3);
  refused("cut.ply", "cut short");
  std::ofstream(folder.Path("cut2.stl")) << "solid a\n facet normal 0 0 1\n  outer loop\n"
                                            "   vertex 0 0 0\n   vertex 10 0 0\n   vertex 0 10 0\n"
                                            "  endloop\n endfacet\n facet normal 0 0 1\n";
  refused("cut2.stl", "export it again");
  WriteObj(folder.Path("cut.obj"), MakeClosedTube());
  std::filesystem::resize_file(folder.Path("cut.obj"),
                               std::filesystem::file_size(folder.Path("cut.obj")) * 4 / 5);
  refused("cut.obj", "cut short");
  std::ofstream binary(folder.Path("binary.ply"), std::ios::binary);
  binary << "ply\nformat binary_little_endian 1.0\nelement vertex 99\nproperty float x\nproperty "
            "float y\nproperty float z\nelement face 9\nproperty list uchar int vertex_indices\n"
            "end_header\n"
         << std::string(700, '\0');
  binary.close();
  CHECK_THROWS_AS(read("binary.ply"), UserError);

  TriangleMesh tube = MakeClosedTube();
  tube.vertices_mm[7].y() = std::nan("");
  WriteBinaryStl(folder.Path("nan.stl"), tube);
  refused("nan.stl", "not a finite number");
  tube.vertices_mm[7].y() = 1e300;
  WriteBinaryStl(folder.Path("huge.stl"), tube);
  CHECK_THROWS_AS(read("huge.stl"), UserError);
}

TEST_CASE("the neuro arch is a closed lumen with inward normals") {
  const SurfaceMesh surface =
      ReadSurface(torquer::test::SourcePath("/host/scenes/meshes/neuro_arch/surface.obj"),
                  MeshUnit::kMillimeter);
  CHECK(surface.report.was_inward);
  CHECK_FALSE(surface.report.was_shell);
  CHECK(surface.report.openings.empty());
  CHECK(surface.report.intersections == 0);
  CHECK(surface.mesh.triangles.size() == 3584);
  CHECK(surface.report.volume_mm3 == Approx(316600).epsilon(0.01));
}

TEST_CASE("in the abdominal aorta the lumen is found, not the wall") {
  const std::string path =
      torquer::test::SourcePath("/host/scenes/meshes/abdominal_aorta/surface.stl");
  const SurfaceMesh surface = ReadSurface(path, MeshUnit::kMeter);
  CHECK(surface.report.was_shell);
  CHECK(surface.report.openings.size() == 6);
  CHECK(surface.report.openings[0].radius_mm == Approx(13.3).margin(0.5));
  CHECK(surface.report.width_mm[1] > 8);  // the wall is 2 mm thick
  const TriangleBvh lumen(surface.mesh);
  const TriangleMesh wall = ImportMesh(ReadMeshContents(path), path, 1000);
  // A point just inside every opening is in the lumen, far from the wall; the wall's own material
  // is outside.
  for (const Opening& opening : surface.report.openings) {
    CHECK(lumen.Distance(opening.center_mm + 4 * opening.inward) >
          0.3 * std::min(3.5, opening.radius_mm));
    CHECK(lumen.Distance(opening.center_mm - 3 * opening.inward) < 0);
  }
  size_t inside = 0;
  for (size_t i = 0; i < wall.triangles.size(); ++i) {
    inside += lumen.Distance(wall.Centroid(i)) > 0.3 ? 1 : 0;
  }
  CHECK(inside < wall.triangles.size() / 200);
  CHECK_THROWS_WITH(ReadSurface(path, MeshUnit::kMillimeter), Contains("mesh_unit = \"m\""));
}

}  // namespace
}  // namespace torquer::vessel
