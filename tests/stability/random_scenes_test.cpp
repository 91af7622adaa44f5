// Random scenes under random hands: any layout of instruments with any effects.
#include <catch2/catch.hpp>
#include <cstdlib>
#include <random>
#include <set>
#include <string>

#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/scene.h"
#include "host/study/cases/random_scene.h"
#include "host/study/cases/scene_run.h"
#include "tests/support/sanitizer.h"

namespace torquer::test {
namespace {

TEST_CASE("Random scenes hold every condition under random hands") {
  const char* text = std::getenv("TORQUER_SEED");
  const unsigned first =
      text == nullptr ? 1 : static_cast<unsigned>(std::strtoul(text, nullptr, 10));
  for (unsigned seed = first; seed < first + static_cast<unsigned>(Rounds(60, 12)); ++seed) {
    std::mt19937 random(seed);
    const std::string file = study::RandomScene(random);
    INFO("TORQUER_SEED=" << seed << "\n" << file);
    scene::Scene scene(scene::ParseScene(file, "random.toml", "."));
    const study::SceneOutcome outcome = study::RunScene(scene, random, 16);
    CHECK(outcome.broken == "");
    CHECK(outcome.ticks > 20);
  }
}

TEST_CASE("Random scenes have every effect but pictures, and every layout") {
  std::set<std::string> missing;
  for (const effects::EffectKind& kind : effects::AllEffects()) missing.insert(kind.name);
  REQUIRE(missing.erase("fluoroscopy") + missing.erase("lateral_plane") == 2);
  std::set<std::size_t> counts;
  bool beside = false;
  bool beside_in_lumen = false;
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    const scene::SceneSpec spec = scene::ParseScene(study::RandomScene(random), "random.toml", ".");
    for (const scene::EffectSpec& effect : spec.effects) missing.erase(effect.name);
    counts.insert(spec.instruments.size());
    for (const scene::InstrumentSpec& instrument : spec.instruments) {
      if (!instrument.entry) continue;
      beside = true;
      beside_in_lumen = beside_in_lumen || &instrument != &spec.instruments.back();
    }
  }
  CHECK(missing == std::set<std::string>());
  CHECK(counts == std::set<std::size_t>{1, 2, 3, 4});
  CHECK(beside);
  CHECK(beside_in_lumen);
}

}  // namespace
}  // namespace torquer::test
