#include "host/simulator/vessel/kinds/straight_tube.h"

#include <fmt/format.h>

#include "host/simulator/vessel/phantoms.h"

namespace torquer::vessel {

namespace {

struct StraightTubeSpec : TableSpec {
  double length_mm = 0;
  double radius_mm = 0;
};

const Keys<StraightTubeSpec>& StraightTubeKeys() {
  static const Keys<StraightTubeSpec> keys =
      Keys<StraightTubeSpec>()
          .Required()
          .Number("length_mm", &StraightTubeSpec::length_mm, 1, 5000, "mm",
                  "length of the tube's axis, along +x")
          .Required()
          .Number("radius_mm", &StraightTubeSpec::radius_mm, 0.1, 50, "mm", "radius of the lumen")
          .Example(
              "kind = \"straight_tube\"\n"
              "wall_stiffness_N_mm2 = 1\n"
              "length_mm = 200\n"
              "radius_mm = 4\n");
  return keys;
}

Vessel Build(const StraightTubeSpec& spec, const std::filesystem::path& /*folder*/) {
  return FromTubes(
      MakeStraightTube(spec.length_mm, spec.radius_mm),
      fmt::format("straight tube, {:g} mm, radius {:g} mm", spec.length_mm, spec.radius_mm));
}

}  // namespace

VesselKind StraightTubeKind() {
  return MakeVesselKind("straight_tube", "straight tube from the origin along +x",
                        StraightTubeKeys(), Build);
}

}  // namespace torquer::vessel
