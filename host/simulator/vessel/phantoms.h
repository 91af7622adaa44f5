// Ready-made analytic vessels, for scenes, tests and benchmarks.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "host/simulator/vessel/brick_field.h"
#include "host/simulator/vessel/tube_field.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

/// Vessel of tubes, with the data that a scene needs.
struct TubeVessel {
  std::unique_ptr<TubeField> field;
  CenterlineNetwork centerlines;  ///< curve 0 is the main path, which begins at the entry
  Eigen::AlignedBox3d bounds_mm;

  /// Entry of the vessel: start of the main path.
  Eigen::Vector3d entry_point_mm() const { return centerlines.curves()[0].At(0).position_mm; }
  Eigen::Vector3d entry_direction() const { return centerlines.curves()[0].At(0).tangent; }
};

/// A T-like and then a Y-like bifurcation after the phantom of Baier et al. (2016), Fig. 12.
///
/// Radius 4 mm everywhere, edges rounded over 2 mm. A straight stem of 100 mm runs from the origin
/// along +x into a crossbar. The crossbar's main side leaves 75 degrees off the stem, its other
/// side 105. The main side bends by 30 degrees; after 80 mm, two children leave it at 30 degrees
/// each. The main path ("main": stem, main side, one child) is about 284 mm long. The other curves
/// are "side" (the crossbar's other side) and "child" (the other child). The bend of the main side
/// leaves the stem's plane, so the phantom is not planar.
TubeVessel MakeTyPhantom();

/// A straight tube from the origin along +x, its centerline length_mm long.
TubeVessel MakeStraightTube(double length_mm, double radius_mm);

/// Arc of a torus: begins at the origin along +x and turns toward +y. `bend_radius_mm`: of its
/// axis. `angle_rad`: in (0, 2 pi].
TubeVessel MakeTorus(double bend_radius_mm, double radius_mm, double angle_rad);

/// Vessel of tubes. The centerlines are the tubes' axes, joined within join_tolerance_mm; the first
/// tube's is the main path. Throws UserError on unusable tubes or too long axes.
TubeVessel MakeTubeVessel(const std::vector<Tube>& tubes, double union_width_mm,
                          double join_tolerance_mm);

/// Bricks for the look-ups of a wire in tubes. `voxel_mm`: cell width, 0.02 to 4; by default a
/// third of the smallest radius, at most 0.25. Throws UserError if the index does not fit into
/// memory.
std::shared_ptr<const BrickField> MakeTubeBricks(std::shared_ptr<const TubeField> field,
                                                 std::optional<double> voxel_mm = {});

/// Vessel of a scene from tubes.
Vessel FromTubes(TubeVessel tubes, std::string description);

}  // namespace torquer::vessel
