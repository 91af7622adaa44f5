#include "host/simulator/effects/torsion.h"

namespace torquer::effects {

namespace {

// GJ / EI of a round wire is 1 / (1 + Poisson's ratio): 0.77 of steel, 0.75 of nitinol.
constexpr Key kRatio = {
    "rigidity_ratio", "", 0.01, 10, 0.77, "torsional over flexural rigidity, GJ / EI, everywhere"};

ShapeChange Twist(StrictTable& keys) {
  return [ratio = kRatio.Read(keys)](std::vector<WireSection>& sections) {
    for (WireSection& section : sections) {
      section.torsional_rigidity_N_mm2 = ratio * section.rigidity_N_mm2;
    }
  };
}

}  // namespace

EffectKind TorsionKind() {
  return {.name = "torsion",
          .summary = "the wire twists: its tip may lag behind the hand and whip round",
          .roles = "shape",
          .keys = {kRatio},
          .other_keys = {},
          .needs = "",
          .make = nullptr,
          .shape = Twist};
}

}  // namespace torquer::effects
