// Fuzz target for scene files. An accepted file is written again and must read back the same.
#include <stdexcept>

#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "tests/fuzz/target.h"

namespace torquer::fuzz::scene_target {
namespace {

std::vector<Bytes> Seeds() {
  std::vector<Bytes> seeds;
  for (const char* name : {"drill_tube", "triaxial", "everything", "ty_phantom", "calcified"}) {
    seeds.push_back(ToBytes(SourceText("host/scenes/" + std::string(name) + ".toml")));
  }
  return seeds;
}

bool Accepts(std::span<const std::uint8_t> input) {
  const scene::SceneSpec spec = scene::ParseScene(ToText(input), "fuzz.toml", "/nowhere");
  const std::string written = scene::WriteScene(spec);
  try {
    if (scene::WriteScene(scene::ParseScene(written, "written.toml", "/nowhere")) != written) {
      throw std::logic_error("written again, it is another scene");
    }
  } catch (const UserError& e) {
    throw std::logic_error(std::string("what is written cannot be read: ") + e.what());
  }
  return true;
}

const Registration kRegistration(
    {.name = "scene", .seeds = Seeds, .accepts = Accepts, .replay_inputs = 2000, .longest = 8192});

}  // namespace
}  // namespace torquer::fuzz::scene_target
