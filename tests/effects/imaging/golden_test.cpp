// Golden pictures: whole pictures compared with checked ones. `imaging_test "[golden-write]"`
// writes them again; look at them before you commit them.
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <sstream>

#include "host/simulator/simulation.h"
#include "host/support/angles.h"
#include "tests/effects/vascular_scene.h"
#include "tests/support/paths.h"

using torquer::kRadPerDeg;
using torquer::effects::ImageSource;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::SceneOf;

namespace {

constexpr int kSize = 128;

// The coronary arteries 1.2 s after the start of an injection, nearly without noise.
std::vector<std::uint8_t> Coronary(const std::string& mode, double lao_deg, double cra_deg) {
  std::ifstream in(torquer::test::SourcePath("/host/scenes/coronary.toml"));
  std::stringstream text;
  text << in.rdbuf();
  std::string scene_text = text.str();
  scene_text.erase(scene_text.find("name = "), scene_text.find("\n\n") - scene_text.find("name"));
  const std::string key = "[effects.fluoroscopy]\n";
  scene_text.insert(scene_text.find(key) + key.size(),
                    "width_px = 128\nheight_px = 128\nphotons = 1e7\nmode = \"" + mode + "\"\n");
  SceneOf scene(scene_text);
  Simulation session(*scene);
  ImageSource::Picture picture;
  Command command;
  command.target = session.target();
  command.controls = {lao_deg * kRadPerDeg, cra_deg * kRadPerDeg, true, false};
  for (int k = 1; k <= 130; ++k) {
    command.time_s = 0.01 * k;
    command.controls.contrast = k > 10;
    torquer::CountedBudget budget(1000);
    session.Tick(command, budget);
    if (session.picture_due()) session.image()->Render(picture);
  }
  return picture.gray;
}

struct Golden {
  const char* name;
  const char* mode;
  double lao_deg, cra_deg;
};
const Golden kGolden[] = {{"plain_rao_caudal", "plain", -25, -20},
                          {"subtraction_lao_cranial", "subtraction", 45, 25},
                          {"roadmap_front", "roadmap", 0, 0}};

std::string PathOf(const Golden& golden) {
  return torquer::test::SourcePath("/tests/effects/imaging/golden/") + golden.name + ".pgm";
}

}  // namespace

TEST_CASE("Pictures look as those that were looked at", "[effects]") {
  for (const Golden& golden : kGolden) {
    INFO(golden.name);
    std::ifstream in(PathOf(golden), std::ios::binary);
    std::string header(15, ' ');
    in.read(header.data(), 15);
    REQUIRE(header == "P5\n128 128\n255\n");
    std::vector<std::uint8_t> expected(static_cast<std::size_t>(kSize * kSize));
    in.read(reinterpret_cast<char*>(expected.data()), kSize * kSize);
    REQUIRE(in);
    const std::vector<std::uint8_t> found = Coronary(golden.mode, golden.lao_deg, golden.cra_deg);
    REQUIRE(found.size() == expected.size());
    int far = 0;
    double sum = 0;
    for (std::size_t i = 0; i < found.size(); ++i) {
      const int difference = std::abs(static_cast<int>(found[i]) - static_cast<int>(expected[i]));
      sum += difference;
      far += difference > 8;
    }
    // On another machine the wire may come to rest at a slightly different place.
    CHECK(sum / (kSize * kSize) < 0.5);
    CHECK(far < 40);
  }
}

TEST_CASE("Writing the pictures to compare with", "[.golden-write]") {
  for (const Golden& golden : kGolden) {
    const std::vector<std::uint8_t> gray = Coronary(golden.mode, golden.lao_deg, golden.cra_deg);
    std::ofstream out(PathOf(golden), std::ios::binary);
    out << "P5\n128 128\n255\n";
    out.write(reinterpret_cast<const char*>(gray.data()),
              static_cast<std::streamsize>(gray.size()));
    REQUIRE(out);
  }
}
