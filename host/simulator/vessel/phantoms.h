// Ready-made analytic vessels, for scenes, tests and benchmarks.
#pragma once

#include <memory>

#include "host/simulator/vessel/tube_field.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::vessel {

/// A vessel of tubes with what a scene needs to know of it.
struct TubeVessel {
  std::unique_ptr<TubeField> field;
  CenterlineNetwork centerlines;  ///< curve 0 is the main path, which begins at the entry
  Eigen::AlignedBox3d bounds_mm;

  /// The vessel's own entry: begin of the main path.
  Eigen::Vector3d entry_point_mm() const { return centerlines.curves()[0].At(0).position_mm; }
  Eigen::Vector3d entry_direction() const { return centerlines.curves()[0].At(0).tangent; }
};

/// A T-like and then a Y-like bifurcation after the phantom of Baier et al. (2016), Fig. 12.
///
/// Radius 4 mm everywhere, edges rounded over 2 mm. A straight stem of 100 mm from the origin along
/// +x meets a crossbar head-on (75 degrees off the stem to the main side, 105 to the other); 80 mm
/// along the main side, which bends by 30 degrees, two children leave at 30 degrees each. Main path
/// ("main": stem, main side, one child) about 284 mm long. The other curves are "side" (the
/// crossbar's other arm) and "child" (the other child). The crossbar's far part is tilted 30
/// degrees out of the stem's plane, so nothing is planar by accident.
TubeVessel MakeTyPhantom();

/// A straight tube from the origin along +x, its centerline length_mm long.
TubeVessel MakeStraightTube(double length_mm, double radius_mm);

/// An arc of a torus: begins at the origin along +x and turns toward +y on bend_radius_mm by
/// angle_rad in (0, 2 pi].
TubeVessel MakeTorus(double bend_radius_mm, double radius_mm, double angle_rad);

/// Tubes of a scene: the centerlines are the tubes' axes, joined within join_tolerance_mm; the
/// first tube's is the main path.
TubeVessel MakeTubeVessel(const std::vector<Tube>& tubes, double union_width_mm,
                          double join_tolerance_mm);

/// The same as a vessel of a scene.
Vessel FromTubes(TubeVessel tubes, std::string description);

}  // namespace torquer::vessel
