// The wire from a table: rigidity, radius and rest shape along it.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Reads the table. Throws UserError naming file, key, value and remedy.
std::vector<WireSection> ReadSections(StrictTable& keys);

EffectKind SectionsKind();

}  // namespace torquer::effects
