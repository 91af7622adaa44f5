#include "host/simulator/effects/instruments/torsion.h"

namespace torquer::effects {

namespace {

struct TorsionSpec : TableSpec {};

const Keys<TorsionSpec>& TorsionKeys() {
  static const Keys<TorsionSpec> keys = Keys<TorsionSpec>().Example("");
  return keys;
}

void Twist(std::vector<WireSection>& sections, double torsional_ratio) {
  for (WireSection& section : sections) {
    section.torsional_rigidity_N_mm2 = torsional_ratio * section.rigidity_N_mm2;
  }
}

}  // namespace

EffectKind TorsionKind() {
  return {.name = "torsion",
          .summary = "torsion of the instruments: the tip may lag behind the hand and whip",
          .roles = "setup",
          .keys = Any(TorsionKeys()),
          .make = nullptr,
          .shape = Twist};
}

}  // namespace torquer::effects
