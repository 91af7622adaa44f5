// Tubes along lines and arcs, joined smoothly.
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind TubesKind();

}  // namespace torquer::vessel
