#include "host/simulator/vessel/kinds/torus.h"

#include <fmt/format.h>

#include <numbers>

#include "host/simulator/vessel/phantoms.h"

namespace torquer::vessel {

namespace {

struct TorusSpec : TableSpec {
  double bend_radius_mm = 0;
  double radius_mm = 0;
  double angle_deg = 0;
};

const Keys<TorusSpec>& TorusKeys() {
  static const Keys<TorusSpec> keys =
      Keys<TorusSpec>()
          .Required()
          .Number("bend_radius_mm", &TorusSpec::bend_radius_mm, 1, 5000, "mm",
                  "bend radius of the arc's axis")
          .Required()
          .Number("radius_mm", &TorusSpec::radius_mm, 0.1, 50, "mm", "radius of the lumen")
          .Required()
          .Number("angle_deg", &TorusSpec::angle_deg, 1, 360, "deg", "angle that the arc spans")
          .Example(
              "kind = \"torus\"\n"
              "wall_stiffness_N_mm2 = 1\n"
              "bend_radius_mm = 40\n"
              "radius_mm = 4\n"
              "angle_deg = 180\n");
  return keys;
}

Vessel Build(const TorusSpec& spec, const std::filesystem::path& /*folder*/) {
  return FromTubes(
      MakeTorus(spec.bend_radius_mm, spec.radius_mm, spec.angle_deg * std::numbers::pi / 180),
      fmt::format("torus arc, bend radius {:g} mm, radius {:g} mm", spec.bend_radius_mm,
                  spec.radius_mm));
}

}  // namespace

VesselKind TorusKind() {
  return MakeVesselKind("torus", "arc of a torus, from the origin along +x towards +y", TorusKeys(),
                        Build);
}

}  // namespace torquer::vessel
