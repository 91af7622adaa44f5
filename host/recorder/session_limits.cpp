#include "host/recorder/session_limits.h"

#include <limits>

#include "host/support/number.h"
#include "host/support/strict_toml.h"

namespace torquer {
namespace {

// Value of an effect's key from the scene, or its default; nullopt if the scene lacks the effect.
// Each effect has its own parameter type. Only the written form and the key table are common to
// all.
std::optional<double> NumberOf(StrictTable& effects, const std::string& effect,
                               const std::string& name) {
  constexpr double kAny = std::numeric_limits<double>::max();
  StrictTable* given = effects.OptionalTable(effect);
  if (given == nullptr) return std::nullopt;
  if (given->Has(name)) return given->Number(name, -kAny, kAny);
  for (const scene::Section& section : scene::AllSections()) {
    if (section.name != "effects." + effect) continue;
    for (const Key& key : section.keys->keys()) {
      if (key.name == name) return ParseNumber(key.fallback);
    }
  }
  return std::nullopt;
}

}  // namespace

SessionLimits ReadLimits(const scene::SceneSpec& scene) {
  StrictTable written = StrictTable::Parse(scene::WriteScene(scene), scene.path);
  SessionLimits limits;
  StrictTable* effects = written.OptionalTable("effects");
  if (effects == nullptr) return limits;
  if (StrictTable* assessment = effects->OptionalTable("assessment")) {
    limits.target_centerline = assessment->Text("target_centerline");
  }
  limits.target_at_mm = NumberOf(*effects, "assessment", "target_at_mm");
  limits.target_radius_mm = NumberOf(*effects, "assessment", "target_radius_mm");
  limits.force_limit_mN = NumberOf(*effects, "assessment", "force_limit_mN");
  limits.patch_mm = NumberOf(*effects, "wall_force", "patch_mm");
  limits.threshold_mN = NumberOf(*effects, "wall_force", "threshold_mN");
  return limits;
}

}  // namespace torquer
