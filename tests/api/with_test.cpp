// Scenes with other values of some keys.
#include <torquer/torquer.h>

#include <catch2/catch.hpp>
#include <cstdint>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/scenes.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::Scene;
using torquer::Values;

std::uint64_t HashOfText(const std::string& more) {
  return Scene::FromText(torquer::test::SceneText(more), ".").content_hash();
}

// A box along x, 40 mm long, whose other sides are twice `half_mm`.
void WriteBox(const std::string& path, double half_mm) {
  std::ofstream out(path);
  for (int corner = 0; corner < 8; ++corner) {
    out << "v " << (corner & 1) * 40 << ' ' << ((corner & 2) != 0 ? half_mm : -half_mm) << ' '
        << ((corner & 4) != 0 ? half_mm : -half_mm) << '\n';
  }
  for (const char* const face :
       {"1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"}) {
    out << "f " << face << '\n';
  }
}

}  // namespace

TEST_CASE("A scene with a value is the scene whose file has it", "[api]") {
  const torquer::test::SceneFile file("[effects.friction]\ncoefficient = 0.1\n");
  const Scene scene = Scene::FromFile(file.path());
  const Scene slippery = scene.With({{"effects.friction.coefficient", 0.3}});
  CHECK(slippery.content_hash() == HashOfText("[effects.friction]\ncoefficient = 0.3\n"));
  CHECK(slippery.path() == file.path());
  CHECK(scene.With({}).content_hash() == scene.content_hash());
  // Values of other types: whole numbers, texts, lists, tables that are added or removed.
  const Values values = {{"relaxation.budget_units", 7},
                         {"relaxation.method", "newton"},
                         {"instrument.guidewire.from_tip_mm", std::vector<double>{0, 40}},
                         {"instrument.guidewire.rigidity_N_mm2", std::vector<double>{0.01, 0.02}},
                         {"effects.friction", false},
                         {"effects.internal_forces", true}};
  const Scene other = scene.With(values);
  CHECK(other.effects() == std::vector<std::string>{"internal_forces"});
  std::string text = torquer::test::SceneText(
      "from_tip_mm = [0, 40]\n[relaxation]\nbudget_units = 7\n[effects.internal_forces]\n");
  const std::string plain = "rigidity_N_mm2 = 6.35e-3";
  text.replace(text.find(plain), plain.size(), "rigidity_N_mm2 = [0.01, 0.02]");
  CHECK(other.content_hash() == Scene::FromText(text, ".").content_hash());
  // A later call continues from the earlier one; an absent value is the default.
  CHECK(other.With({{"relaxation.budget_units", std::monostate()}}).content_hash() ==
        scene.With({values.begin() + 1, values.end()}).content_hash());
  CHECK(Scene::FromText(other.text(), other.folder()).content_hash() == other.content_hash());
}

TEST_CASE("A scene with a value keeps the vessel, unless a key of it changes", "[api]") {
  const torquer::test::TemporaryFolder folder;
  WriteBox(folder.Path("tube.obj"), 3);
  const Scene scene = Scene::FromText(
      "name = \"tube\"\n[vessel]\nkind = \"surface\"\nfile = \"tube.obj\"\nmesh_unit = \"mm\"\n"
      "voxel_mm = 2\nwall_stiffness_N_mm2 = 1\n[entry]\npoint_mm = [5, 0, 0]\n"
      "direction = [1, 0, 0]\n[[instrument]]\nname = \"wire\"\nmax_length_mm = 30\n"
      "radius_mm = 0.2\nrigidity_N_mm2 = 0.01\n",
      folder.Path());
  WriteBox(folder.Path("tube.obj"), 2);
  const Scene stiff = scene.With({{"vessel.wall_stiffness_N_mm2", 2.0}});
  CHECK(stiff.bounds_mm() == scene.bounds_mm());
  const Scene again = scene.With({{"vessel.voxel_mm", 1.0}});
  CHECK(again.bounds_mm()[1][1] < scene.bounds_mm()[1][1]);
  // The hash belongs to the scene's surface.
  CHECK(stiff.content_hash() != Scene::FromText(stiff.text(), stiff.folder()).content_hash());
  CHECK(again.content_hash() == Scene::FromText(again.text(), again.folder()).content_hash());
}

TEST_CASE("A value that a scene cannot have is refused with its key and the remedy", "[api]") {
  const torquer::test::SceneFile file;
  const Scene scene = Scene::FromFile(file.path());
  const auto refuse = [&](const Values& values, const std::string& said) {
    CHECK_THROWS_WITH(scene.With(values), Contains(said));
  };
  refuse({{"effects.friction.coefficient", 5.0}},
         file.path() + ": effects.friction.coefficient = 5.0: is out of range; give a number from");
  refuse({{"effects.friction.coefficient", 0.1}, {"effects.friction.regoin", "x"}},
         "did you mean region?");
  refuse({{"effects.frictoin.coefficient", 0.1}}, "did you mean friction?");
  refuse({{"relaxation.segment_mm", "long"}}, "relaxation.segment_mm = 'long': is not a number");
  refuse({{"effects.friction", 0.2}}, "write [effects.friction]");
  refuse(
      {{"instrument.guide.radius_mm", 0.2}},
      "the key \"instrument.guide.radius_mm\" names no instrument; did you mean guidewire? there "
      "are: guidewire");
  refuse({{"instrument.radius_mm", 0.2}}, "give instrument.NAME.KEY");
  refuse({{"name.first", "x"}}, "leads into name, which is a value");
  refuse({{"effects..coefficient", 0.2}}, "empty part");
  refuse({{"", true}}, "empty part");
  refuse({{"vessel", 1}}, "vessel");
  std::string deep = "a";
  for (int k = 0; k < 100000; ++k) deep += ".a";
  refuse({{deep, 1}}, "more than 16 parts");
  // Keys that were not set have their lines.
  refuse({{"instrument.guidewire.tip_mm", 0.0}},
         file.path() + ":13: instrument[0].tip_angle_deg = 30: needs tip_mm");
  CHECK(scene.With({{"effects.gravity", false}}).content_hash() == scene.content_hash());
}
