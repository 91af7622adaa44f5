#include "host/simulator/vessel/kinds/tubes.h"

#include <fmt/format.h>

#include <memory>
#include <optional>
#include <utility>

#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/support/error.h"

namespace torquer::vessel {

namespace {

struct TubeSpec : TableSpec {
  std::string name;
  std::vector<Eigen::Vector3d> points_mm;
  double bend_radius_mm = 1e6;
  std::vector<double> radii_mm;
};

struct TubesSpec : TableSpec {
  double union_width_mm = 2;
  std::optional<double> voxel_mm;
  double join_tolerance_mm = 1;
  std::vector<TubeSpec> tubes;
};

const Keys<TubeSpec>& TubeKeys() {
  static const Keys<TubeSpec> keys =
      Keys<TubeSpec>()
          .Required()
          .Text("name", &TubeSpec::name, "name of the tube and of its centerline")
          .Required()
          .Points("points_mm", &TubeSpec::points_mm, 2, "mm", "corners of the tube's axis")
          .Number("bend_radius_mm", &TubeSpec::bend_radius_mm, 0.1, 1e6, "mm",
                  "largest radius of the arcs that round the corners")
          .Required()
          .Numbers(
              "radii_mm", &TubeSpec::radii_mm, 0.1, 50, "mm",
              "radius of the lumen: one value, or one per point in points_mm, joined by a monotone "
              "cubic with slope 0 at the ends and at local extremes; between two points with slope "
              "0 it changes by t^2 (3 - 2 t) of their difference, where t is the fraction of the "
              "axis between them")
          .Checked([](const TubeSpec& spec, StrictTable& table) {
            if (spec.radii_mm.size() == 1 || spec.radii_mm.size() == spec.points_mm.size()) return;
            table.Refuse("radii_mm", fmt::format("needs one radius, or one for each of the {} "
                                                 "points of points_mm",
                                                 spec.points_mm.size()));
          })
          .Example(
              "name = \"left_main\"\n"
              "points_mm = [[0, 0, 0], [14, -1, 1], [24, -4, -2]]\n"
              "bend_radius_mm = 20\n"
              "radii_mm = 2.25\n");
  return keys;
}

const Keys<TubesSpec>& TubesKeys() {
  static const Keys<TubesSpec> keys =
      Keys<TubesSpec>()
          .Number("union_width_mm", &TubesSpec::union_width_mm, 0, 20, "mm",
                  "width over which the edges between tubes are rounded")
          .Otherwise("a third of the smallest radius, at most 0.25 mm")
          .Number("voxel_mm", &TubesSpec::voxel_mm, 0.02, 4, "mm",
                  "finest cell of the distance field; at most half the thickness of the thinnest "
                  "wall between two lumens")
          .Number("join_tolerance_mm", &TubesSpec::join_tolerance_mm, 0.01, 50, "mm",
                  "distance to another tube's axis within which the end of a tube joins it")
          .Tables("tube", &TubesSpec::tubes, TubeKeys(), 1,
                  "tubes of the vessel; the first is the main tube")
          .Example(
              "kind = \"tubes\"\n"
              "wall_stiffness_N_mm2 = 5\n"
              "union_width_mm = 1\n"
              "[[vessel.tube]]\n"
              "name = \"trunk\"\n"
              "points_mm = [[0, 0, 0], [60, 0, 0]]\n"
              "radii_mm = 3\n"
              "[[vessel.tube]]\n"
              "name = \"branch\"\n"
              "points_mm = [[40, 0, 0], [60, 15, 5]]\n"
              "radii_mm = [2, 1.5]\n");
  return keys;
}

Tube MakeTube(const TubeSpec& spec) {
  try {
    Tube tube{spec.name,
              ArcLinePath::FromCorners(spec.points_mm, spec.bend_radius_mm),
              spec.radii_mm,
              {0}};
    if (spec.radii_mm.size() > 1) tube.radius_at_mm = tube.axis.corner_arc_lengths_mm();
    return tube;
  } catch (const UserError& error) {
    spec.origin.Refuse("points_mm", error.what());
  }
}

// Null if the index of the bricks does not fit into memory. Then the vessel is large and its tubes
// are thin.
std::shared_ptr<const BrickField> MakeBricks(const std::shared_ptr<const TubeField>& field,
                                             const TubesSpec& spec) {
  try {
    return MakeTubeBricks(field, spec.voxel_mm);
  } catch (const UserError& error) {
    if (spec.voxel_mm) spec.origin.Refuse("voxel_mm", error.what());
    return nullptr;
  }
}

Vessel Build(const TubesSpec& spec, const std::filesystem::path& /*folder*/) {
  std::vector<Tube> tubes;
  for (const TubeSpec& tube : spec.tubes) tubes.push_back(MakeTube(tube));
  try {
    TubeVessel made = MakeTubeVessel(tubes, spec.union_width_mm, spec.join_tolerance_mm);
    const std::shared_ptr<const TubeField> field = std::move(made.field);
    Vessel vessel = FromTubes(std::move(made), fmt::format("{} tubes", tubes.size()));
    vessel.field = field;
    vessel.bricks = MakeBricks(field, spec);
    return vessel;
  } catch (const UserError& error) {
    spec.origin.Refuse("tube", error.what());
  }
}

}  // namespace

VesselKind TubesKind() {
  return MakeVesselKind("tubes", "tubes along lines and arcs, with smooth junctions", TubesKeys(),
                        Build);
}

}  // namespace torquer::vessel
