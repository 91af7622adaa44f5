// A patient's surface from a file: STL, OBJ or PLY.
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind SurfaceKind();

}  // namespace torquer::vessel
