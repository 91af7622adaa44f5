// STL files as programs write them, and messages about damaged ones.
#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdint>
#include <string>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/mesh_import.h"
#include "host/support/error.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;

std::string AsText(const TriangleMesh& mesh, size_t triangles_per_solid) {
  std::string text;
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (i % triangles_per_solid == 0) text += "solid part " + std::to_string(i) + "\n";
    text += " facet normal 0 0 0\n  outer loop\n";
    for (int corner = 0; corner < 3; ++corner) {
      const Eigen::Vector3d& v = mesh.Corner(i, corner);
      text += "   vertex " + std::to_string(v.x()) + " " + std::to_string(v.y()) + " " +
              std::to_string(v.z()) + "\n";
    }
    text += "  endloop\n endfacet\n";
    const bool ends = (i + 1) % triangles_per_solid == 0 || i + 1 == mesh.triangles.size();
    if (ends) text += "endsolid\n";
  }
  return text;
}

std::string AsBinary(const TriangleMesh& mesh) {
  const test::TemporaryFolder folder;
  WriteBinaryStl(folder.Path("a.stl"), mesh);
  return test::Contents(folder.Path("a.stl"));
}

void CheckIsTheTube(const std::string& contents) {
  const TriangleMesh tube = MakeClosedTube();
  const TriangleMesh read = ImportMesh(contents, "a.stl", 1);
  CHECK(read.triangles.size() == tube.triangles.size());
  CHECK(read.Area() == Approx(tube.Area()).epsilon(1e-4));
  CHECK(read.Volume() == Approx(tube.Volume()).epsilon(1e-4));
}

std::string Refusal(const std::string& contents) {
  try {
    ImportMesh(contents, "a.stl", 1);
  } catch (const UserError& error) {
    return error.what();
  }
  return "";
}

TEST_CASE("STL files of other programs give the same tube") {
  const std::string text = AsText(MakeClosedTube(), 100), binary = AsBinary(MakeClosedTube());
  std::string capitals = text, carriage_returns, blanks_first = binary;
  std::transform(text.begin(), text.end(), capitals.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  for (const char c : text) carriage_returns += c == '\n' ? std::string("\r\n") : std::string(1, c);
  blanks_first.replace(0, 6, "solid ");
  CheckIsTheTube(text);
  CheckIsTheTube(capitals);
  CheckIsTheTube(carriage_returns);
  CheckIsTheTube("\n\n" + text);
  CheckIsTheTube("\xef\xbb\xbf" + text);
  CheckIsTheTube(text + "\n \n");
  CheckIsTheTube(AsText(MakeClosedTube(), 1));
  CheckIsTheTube(binary);
  CheckIsTheTube(blanks_first);
  CheckIsTheTube(binary + std::string(40, '\0'));
  CheckIsTheTube(blanks_first + std::string(40, '\0'));
}

TEST_CASE("A damaged STL file is refused with its place and without a library's names") {
  const std::string text = AsText(MakeClosedTube(), 100), binary = AsBinary(MakeClosedTube());
  const auto refused = [](const std::string& contents, const std::string& part) {
    const std::string said = Refusal(contents);
    CHECK_THAT(said, Contains("a.stl:") && Contains(part) && Contains("export"));
    CHECK_THAT(said, !Contains("magic") && !Contains("STL storage"));
  };
  refused("solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 nought\n",
          "a.stl:4: z of a vertex is 'nought', not a finite number");
  refused("solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nendfacet\nendsolid\n",
          "a.stl:5: a facet has 2 vertices, not 3");
  refused("solid a\nfacet normal 0 0 1\nvertex 0 0 0\nvertex 1 0 0\nvertex 1 1 0\nvertex 0 1 0\n",
          "a.stl:6: a facet has more than three vertices");
  refused(text.substr(0, text.size() - 10), "does not end with \"endsolid\"");
  refused("solid a\nendsolid a\n", "holds no triangles");
  refused("this is no surface", "18 bytes and does not begin with \"solid\"");
  refused(binary.substr(0, binary.size() - 60), "announces 1008 triangles, but the file has room");
  refused(binary + binary, "enough for further ones");
}

TEST_CASE("Surfaces are read within 2 s per megabyte, however many solids they have") {
  const double slowness = test::kUnderSanitizer ? 20 : 1;
  const TriangleMesh tube = MakeTubeMesh(40, 60, 80, [](double) { return 3.0; });
  const std::string many = AsText(tube, 1);
  const auto begin = std::chrono::steady_clock::now();
  CHECK(ImportMesh(many, "a.stl", 1).triangles.size() == tube.triangles.size());
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  CHECK(took.count() < slowness * 2e-6 * static_cast<double>(many.size()));
}

TEST_CASE("A file with only lines is refused for its missing triangles") {
  const auto refusal = [](const std::string& contents) {
    try {
      ImportMesh(contents, "a.obj", 1);
    } catch (const UserError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK_THAT(refusal("v 0 0 0\nv 10 0 0\nv 10 9 0\nl 1 2\nl 2 3\n"),
             Contains("a.obj: the file holds no triangles; export the vessel as a surface mesh"));
  CHECK_THAT(refusal("v 0 0 0\nv 10 0 0\nv 10 9 0\n"), !Contains("magic"));
}

}  // namespace
}  // namespace torquer::vessel
