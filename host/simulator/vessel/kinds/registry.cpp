#include "host/simulator/vessel/kinds/straight_tube.h"
#include "host/simulator/vessel/kinds/surface.h"
#include "host/simulator/vessel/kinds/torus.h"
#include "host/simulator/vessel/kinds/tubes.h"
#include "host/simulator/vessel/kinds/ty_phantom.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

const std::vector<VesselKind>& AllVesselKinds() {
  static const std::vector<VesselKind> kinds = {SurfaceKind(), TubesKind(), TyPhantomKind(),
                                                StraightTubeKind(), TorusKind()};
  return kinds;
}

}  // namespace torquer::vessel
