// An arc of a torus.
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind TorusKind();

}  // namespace torquer::vessel
