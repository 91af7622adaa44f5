#include "host/recorder/session_limits.h"

#include <limits>

#include "host/support/number.h"
#include "host/support/strict_toml.h"

namespace torquer {
namespace {

// One effect as the scene has it. The types of effects' keys are their own; what every effect has
// is how it is written, and the table of its keys.
class EffectKeys {
 public:
  EffectKeys(StrictTable& effects, const std::string& effect)
      : given_(effects.OptionalTable(effect)) {
    for (const scene::Section& section : scene::AllSections()) {
      if (section.name == "effects." + effect) keys_ = section.keys;
    }
  }

  std::optional<double> Number(const std::string& key) {
    constexpr double kAny = std::numeric_limits<double>::max();
    if (given_ == nullptr) return std::nullopt;
    if (given_->Has(key)) return given_->Number(key, -kAny, kAny);
    for (const Key& known : keys_->keys()) {
      if (known.name == key) return ParseNumber(known.fallback);
    }
    return std::nullopt;
  }
  std::string Text(const std::string& key) {
    return given_ == nullptr ? "" : given_->Text(key, "");
  }

 private:
  StrictTable* given_;
  const KeyTable* keys_ = nullptr;
};

}  // namespace

SessionLimits ReadLimits(const scene::SceneSpec& scene) {
  StrictTable written = StrictTable::Parse(scene::WriteScene(scene), scene.path);
  SessionLimits limits;
  StrictTable* effects = written.OptionalTable("effects");
  if (effects == nullptr) return limits;
  EffectKeys assessment(*effects, "assessment");
  limits.target_centerline = assessment.Text("target_centerline");
  limits.target_at_mm = assessment.Number("target_at_mm");
  limits.target_radius_mm = assessment.Number("target_radius_mm");
  limits.force_limit_mN = assessment.Number("force_limit_mN");
  EffectKeys wall_force(*effects, "wall_force");
  limits.patch_mm = wall_force.Number("patch_mm");
  limits.threshold_mN = wall_force.Number("threshold_mN");
  return limits;
}

}  // namespace torquer
