// Twist of the wire: a finite torsional rigidity.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

EffectKind TorsionKind();

}  // namespace torquer::effects
