// Files that are replaced while scenes are built from them.
#include <atomic>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <utility>

#include "host/simulator/scene/scene.h"
#include "tests/support/made_meshes.h"
#include "tests/support/sanitizer.h"
#include "tests/support/temporary_folder.h"

using torquer::scene::Scene;

namespace {

// Writes a tube along x, and the curve along its axis.
void WriteTube(const std::string& folder, double length_mm) {
  torquer::vessel::WriteObj(
      folder + "/surface.obj",
      torquer::vessel::MakeTubeMesh(length_mm, 6, 8, [](double) { return 3.0; }));
  std::filesystem::create_directories(folder + "/curves");
  std::ofstream(folder + "/curves/main.mrk.json")
      << R"({"markups": [{"type": "Curve", "controlPoints": [{"position": [0, 0, 0]}, )"
      << R"({"position": [)" << length_mm << R"(, 0, 0]}], "measurements": )"
      << R"([{"name": "Radius", "controlPointValues": [3, 3]}]}]})";
}

constexpr const char* kScene = R"(name = "test"
[vessel]
kind = "surface"
file = "now/surface.obj"
mesh_unit = "mm"
centerlines = "now/curves"
voxel_mm = 4
wall_stiffness_N_mm2 = 1
[entry]
point_mm = [5, 0, 0]
direction = [1, 0, 0]
[[instrument]]
max_length_mm = 50
radius_mm = 0.2
tip_mm = 10
tip_angle_deg = 30
rigidity_N_mm2 = 6.35e-3
)";

}  // namespace

TEST_CASE("A scene's hash is that of the surface and the curves that it has", "[scene]") {
  const torquer::test::TemporaryFolder folder;
  for (const double length_mm : {40.0, 60.0}) {
    const std::string name = length_mm < 50 ? "short" : "long";
    std::filesystem::create_directory(folder.Path(name));
    WriteTube(folder.Path(name), length_mm);
  }
  const std::string path = folder.Path("test.toml");
  std::ofstream(path) << kScene;
  // Replaces a link's target atomically.
  const auto lead_to = [&folder](const std::string& name) {
    std::filesystem::create_directory_symlink(name, folder.Path("next"));
    std::filesystem::rename(folder.Path("next"), folder.Path("now"));
  };
  lead_to("short");
  std::atomic<bool> done = false;
  std::thread swapper([&] {
    for (int i = 0; !done; ++i) lead_to(i % 2 == 0 ? "long" : "short");
  });
  std::map<std::uint64_t, std::pair<double, double>> lengths_mm;
  // Repeats until both versions have been read, up to a limit.
  constexpr int kMost = 50;
  for (int i = 0; i < torquer::test::Rounds(10, 2) || (lengths_mm.size() < 2 && i < kMost); ++i) {
    const Scene scene(path);
    const std::pair<double, double> here{scene.vessel().bounds_mm.max().x(),
                                         scene.vessel().centerlines.curves()[0].length_mm()};
    const auto [known, is_new] = lengths_mm.try_emplace(scene.content_hash(), here);
    CHECK(known->second == here);
  }
  done = true;
  swapper.join();
  CHECK(lengths_mm.size() > 1);
}
