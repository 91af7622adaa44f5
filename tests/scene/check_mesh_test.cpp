// torquer-simulator --check-mesh: its output, its picture, and the scene that it proposes.
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "tests/support/child_process.h"
#include "tests/support/file_contents.h"
#include "tests/support/made_meshes.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using Catch::Contains;
using torquer::test::ChildProcess;
using torquer::test::Contents;
using torquer::test::TemporaryFolder;

namespace {

struct Said {
  int status;
  std::string output, error;
};

Said CheckMesh(const std::vector<std::string>& arguments) {
  std::vector<std::string> words = {torquer::test::ProgramPath("torquer-simulator"),
                                    "--check-mesh"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  ChildProcess program(words);
  const int status = program.Wait();
  return {status, program.Output(), program.Error()};
}

}  // namespace

TEST_CASE("The scene that --check-mesh proposes can be simulated", "[scene]") {
  struct Case {
    std::string what;
    torquer::vessel::TriangleMesh mesh;
    double units_per_mm;
  };
  for (const Case& c : {Case{"open", torquer::vessel::MakeTubeMesh(), 1},
                        Case{"open, in meters", torquer::vessel::MakeTubeMesh(), 0.001},
                        Case{"closed", torquer::vessel::MakeClosedTube(), 1},
                        Case{"a wall with thickness", torquer::vessel::MakeShell(), 1}}) {
    INFO(c.what);
    const TemporaryFolder folder;
    const std::string surface = folder.Path("a \"b\".obj");
    torquer::vessel::WriteObj(surface, c.mesh, c.units_per_mm);
    const Said said = CheckMesh({surface});
    CHECK(said.status == 0);
    CHECK_THAT(said.output, Contains("loads:        yes"));
    CHECK_THAT(Contents(surface + ".svg"), Contains("<svg ") && Contains("</svg>"));
    const std::size_t begin = said.output.find("[vessel]");
    REQUIRE(begin != std::string::npos);
    const std::string path = folder.Path("test.toml");
    std::ofstream(path) << "name = \"test\"\n"
                        << said.output.substr(begin)
                        << "\n[[instrument]]\nmax_length_mm = 30\nradius_mm = 0.5\ntip_mm = 10\n"
                           "tip_angle_deg = 30\nrigidity_N_mm2 = 1\n";
    const torquer::scene::Scene scene(path);
    CHECK(scene.vessel().bounds_mm.sizes().x() == Approx(c.mesh.Bounds().sizes().x()).margin(0.1));
  }
}

TEST_CASE("A mesh check reports why a surface does not load, and draws the places", "[scene]") {
  const TemporaryFolder folder;
  torquer::vessel::TriangleMesh mesh = torquer::vessel::MakeTubeMesh();
  mesh.triangles.push_back({100, 101, 300});  // a wall inside the lumen
  torquer::vessel::WriteObj(folder.Path("wall.obj"), mesh);
  const Said walled = CheckMesh({folder.Path("wall.obj")});
  CHECK(walled.status == 0);
  CHECK_THAT(walled.output, Contains("encloses nothing") && Contains("[vessel]"));
  CHECK_THAT(Contents(folder.Path("wall.obj.svg")), Contains("orange: walls left out"));
  std::erase_if(mesh.triangles,
                [](const auto& t) { return t[0] > 150 && t[0] < 350 && t[0] % 24 < 12; });
  torquer::vessel::WriteObj(folder.Path("a.obj"), mesh);
  const Said said = CheckMesh({folder.Path("a.obj"), "--picture", folder.Path("b.svg")});
  CHECK(said.status == 1);
  CHECK_THAT(said.output, Contains("loads:        no: ") &&
                              Contains("part of the surface is missing") && !Contains("[vessel]"));
  CHECK_THAT(Contents(folder.Path("b.svg")),
             Contains("stroke='#c000c0'") && Contains("stroke='#d00000'"));
  CHECK_FALSE(std::filesystem::exists(folder.Path("a.obj.svg")));

  std::ofstream(folder.Path("c.ply")) << "ply\nformat binary_" << '\0' << '\0';
  const Said cut = CheckMesh({folder.Path("c.ply")});
  CHECK(cut.status == 1);
  CHECK_THAT(cut.output, Contains("end_header") && !Contains("picture"));
  CHECK_FALSE(std::filesystem::exists(folder.Path("c.ply.svg")));

  CHECK(CheckMesh({folder.Path("none.ply")}).status == 2);
}

TEST_CASE("A mesh check works under a hard limit of processor time", "[scene]") {
  const TemporaryFolder folder;
  torquer::vessel::WriteObj(folder.Path("a.obj"), torquer::vessel::MakeTubeMesh());
  // A process that may raise hard limits, as root may, hands this on to no other one here.
  const std::string limited = R"(
ulimit -t 10
without='setpriv --bounding-set -sys_resource'
$without true 2>&- || without=
exec $without "$@")";
  ChildProcess program({"/bin/bash", "-c", limited, "limited",
                        torquer::test::ProgramPath("torquer-simulator"), "--check-mesh",
                        folder.Path("a.obj")});
  CHECK(program.Wait() == 0);
  CHECK_THAT(program.Output(), Contains("loads:        yes"));
}
