// The phantom of the paper.
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind TyPhantomKind();

}  // namespace torquer::vessel
