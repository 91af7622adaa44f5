// T-Y phantom, after Baier et al. (2016).
#pragma once

#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

VesselKind TyPhantomKind();

}  // namespace torquer::vessel
