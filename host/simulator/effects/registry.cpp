#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/friction.h"
#include "host/support/error.h"

namespace torquer::effects {

const std::vector<EffectKind>& AllEffects() {
  static const std::vector<EffectKind> kinds = {
      {"friction", "Coulomb friction of the wire on the wall, with stick and slip", &MakeFriction},
  };
  return kinds;
}

const EffectKind& FindEffect(const std::string& name, const std::string& where) {
  std::vector<std::string> known;
  for (const EffectKind& kind : AllEffects()) {
    if (name == kind.name) return kind;
    known.emplace_back(kind.name);
  }
  std::string all;
  for (const std::string& one : known) all += (all.empty() ? "" : ", ") + one;
  const std::string near = NearestName(name, known);
  throw UserError(where + ": effects." + name + ": there is no such effect; " +
                  (near.empty() ? "" : "did you mean " + near + "? ") + "Known: " + all);
}

}  // namespace torquer::effects
