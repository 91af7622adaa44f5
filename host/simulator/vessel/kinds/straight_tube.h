// A straight tube.
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind StraightTubeKind();

}  // namespace torquer::vessel
