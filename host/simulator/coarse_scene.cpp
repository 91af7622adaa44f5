#include "host/simulator/coarse_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/support/error.h"

namespace torquer::simulator {

namespace {

// True if the effect changes the instruments before they are cut into segments.
bool ShapesWire(const std::string& effect) {
  const std::vector<effects::EffectKind>& kinds = effects::AllEffects();
  return std::any_of(kinds.begin(), kinds.end(), [&](const effects::EffectKind& kind) {
    return kind.name == effect && (kind.shape != nullptr || kind.room != nullptr);
  });
}

bool ActsOnWire(effects::Effect& effect) {
  return effect.energy_term() != nullptr || effect.wall_stiffness() != nullptr ||
         effect.motion() != nullptr || effect.timed() != nullptr || effect.limit() != nullptr;
}

// Names of the effects that only observe the wire.
std::vector<std::string> NamesOfObservers(const scene::Scene& scene) {
  std::vector<std::string> names;
  for (std::size_t k = 0; k < scene.effects().size(); ++k) {
    const std::string& name = scene.names_of_effects()[k];
    if (!ShapesWire(name) && !ActsOnWire(*scene.effects()[k])) names.push_back(name);
  }
  return names;
}

[[noreturn]] void Refuse(const scene::SceneSpec& spec, const std::string& effect,
                         const std::string& reason) {
  const double segment_mm = effects::Comparison::kSegmentFactor * spec.relaxation.segment_mm;
  const std::string problem = fmt::format(
      "it compares with segments of {:g} mm, which this scene cannot have ({}); set "
      "relaxation.segment_mm to less, or remove [effects.{}]",
      segment_mm, reason, effect);
  for (const scene::EffectSpec& of : spec.effects) {
    if (of.name == effect) of.origin.Refuse(effect, problem);
  }
  throw UserError(problem);
}

}  // namespace

std::unique_ptr<scene::Scene> MakeCoarseScene(const scene::Scene& scene,
                                              const std::string& effect) {
  scene::SceneSpec spec = scene.spec();
  spec.relaxation.segment_mm *= effects::Comparison::kSegmentFactor;
  const std::vector<std::string> observers = NamesOfObservers(scene);
  std::erase_if(spec.effects, [&](const scene::EffectSpec& of) {
    return std::find(observers.begin(), observers.end(), of.name) != observers.end();
  });
  try {
    return std::make_unique<scene::Scene>(std::move(spec), scene);
  } catch (const UserError& error) {
    Refuse(scene.spec(), effect, error.what());
  }
}

}  // namespace torquer::simulator
