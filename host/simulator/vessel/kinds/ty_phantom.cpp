#include "host/simulator/vessel/kinds/ty_phantom.h"

#include "host/simulator/vessel/phantoms.h"

namespace torquer::vessel {

namespace {

struct TyPhantomSpec : TableSpec {};

const Keys<TyPhantomSpec>& TyPhantomKeys() {
  static const Keys<TyPhantomSpec> keys = Keys<TyPhantomSpec>().Example(
      "kind = \"ty_phantom\"\n"
      "wall_stiffness_N_mm2 = 0.01\n");
  return keys;
}

Vessel Build(const TyPhantomSpec& /*spec*/, const std::filesystem::path& /*folder*/) {
  return FromTubes(MakeTyPhantom(), "T-Y phantom, radius 4 mm, main path 284 mm");
}

}  // namespace

VesselKind TyPhantomKind() {
  return MakeVesselKind("ty_phantom",
                        "phantom of Baier et al. (2016), with a T-like and a Y-like bifurcation",
                        TyPhantomKeys(), Build);
}

}  // namespace torquer::vessel
