#include "host/simulator/coarse_scene.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::simulator {

namespace {

bool ActsOnWire(effects::Effect& effect) {
  return effect.energy_term() != nullptr || effect.wall_stiffness() != nullptr ||
         effect.motion() != nullptr || effect.timed() != nullptr || effect.limit() != nullptr;
}

// Names of the effects that a scene needs only to observe the wire. Effects that merely shape the
// wire are not among scene.effects().
std::vector<std::string> NamesOfObservers(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < scene.effects().size(); ++k) {
    if (!ActsOnWire(*scene.effects()[k])) names.push_back(scene.names_of_effects()[k]);
  }
  return names;
}

}  // namespace

std::unique_ptr<scene::Scene> MakeCoarseScene(const scene::Scene& scene) {
  scene::SceneSpec spec = scene.spec();
  spec.relaxation.segment_mm *= effects::Comparison::kSegmentFactor;
  const std::vector<std::string> observers = NamesOfObservers(scene);
  std::erase_if(spec.effects, [&](const scene::EffectSpec& effect) {
    return std::find(observers.begin(), observers.end(), effect.name) != observers.end();
  });
  return std::make_unique<scene::Scene>(std::move(spec), scene);
}

}  // namespace torquer::simulator
