// What every effect offers: the roles through which it takes part.
//
// An effect is one file pair and one line in registry.cpp. It exists only in scenes that name it;
// the relaxation knows roles, never effects.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/support/strict_toml.h"

namespace torquer::effects {

/// What effects may look at while they are made. All outlive the effect.
struct EffectContext {
  const WireModel& wire;
  const WallModel& wall;
};

class Effect {
 public:
  Effect() = default;
  Effect(const Effect&) = delete;
  Effect& operator=(const Effect&) = delete;
  virtual ~Effect() = default;

  /// Role *energy term*: null when the effect has none.
  virtual EnergyTerm* energy_term() { return nullptr; }
};

/// One row of the table of effects.
struct EffectKind {
  const char* name;     ///< as in [effects.NAME]
  const char* summary;  ///< one line for people
  /// Reads the effect's keys. Throws UserError naming file, key, value and remedy.
  std::unique_ptr<Effect> (*make)(StrictTable& keys, const EffectContext& context);
};

/// All effects there are.
const std::vector<EffectKind>& AllEffects();

/// The row with a name; throws UserError naming the nearest known one.
const EffectKind& FindEffect(const std::string& name, const std::string& where);

}  // namespace torquer::effects
