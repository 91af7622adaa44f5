// A catheter around the wire: a second instrument with its own length, stiffness, shape and input.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

EffectKind CatheterKind();

}  // namespace torquer::effects
