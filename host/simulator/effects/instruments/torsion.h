// Torsion: instruments that twist under a torque, with a finite torsional rigidity GJ.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

EffectKind TorsionKind();

}  // namespace torquer::effects
