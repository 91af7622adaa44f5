#include "host/simulator/vessel/phantoms.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/simulator/vessel/curve_limits.h"
#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Vector3d;

TubeVessel MakeTubeVessel(const std::vector<Tube>& tubes, double union_width_mm,
                          double join_tolerance_mm) {
  double length_mm = 0;
  for (const Tube& tube : tubes) length_mm += tube.axis.length_mm();
  // Checked before the centerlines are made: the length determines their number of points.
  if (length_mm > kMostCurvesMm) {
    throw UserError("the axes of the tubes are " + std::to_string(std::lround(length_mm)) +
                    " mm long in all; a vessel has at most " +
                    std::to_string(std::lround(kMostCurvesMm)) + " mm: check their unit");
  }
  TubeVessel vessel;
  vessel.field = std::make_unique<TubeField>(tubes, union_width_mm);
  vessel.bounds_mm = vessel.field->bounds_mm();
  std::vector<Centerline> curves;
  for (const Tube& tube : tubes) curves.push_back(CenterlineOf(tube));
  vessel.centerlines = CenterlineNetwork(std::move(curves), join_tolerance_mm);
  return vessel;
}

TubeVessel MakeStraightTube(double length_mm, double radius_mm) {
  ArcLinePath axis(Vector3d::Zero(), Vector3d::UnitX());
  axis.Line(length_mm);
  return MakeTubeVessel({{"tube", axis, {radius_mm}, {}}}, 0, 0);
}

TubeVessel MakeTorus(double bend_radius_mm, double radius_mm, double angle_rad) {
  ArcLinePath axis(Vector3d::Zero(), Vector3d::UnitX());
  axis.Arc(bend_radius_mm, angle_rad, Vector3d::UnitY());
  return MakeTubeVessel({{"torus", axis, {radius_mm}, {}}}, 0, 0);
}

TubeVessel MakeTyPhantom() {
  constexpr double kRadius = 4, kUnionWidth = 2, kDegree = M_PI / 180;
  constexpr double kStem = 100, kSide = 50, kBefore = 30, kBend = 80, kAfter = 8.2;
  constexpr double kChildBend = 30, kChild = 90, kChildTurn = 30 * kDegree;
  const Vector3d crossing(kStem, 0, 0);
  const Vector3d across(std::cos(75 * kDegree), std::sin(75 * kDegree), 0);
  const Vector3d out_of_plane(-0.8, 0.2, 0.5), child_side(0.3, -0.2, 1);

  // A tube that begins on another's axis would dent the opposite wall, so tubes begin off it.
  ArcLinePath stem(Vector3d::Zero(), Vector3d::UnitX());
  stem.Line(kStem - kUnionWidth - 0.5);
  ArcLinePath crossbar(crossing - kSide * across, across);
  crossbar.Line(kSide + kBefore).Arc(kBend, 30 * kDegree, out_of_plane).Line(kAfter);
  const Vector3d fork = crossbar.PointAt(crossbar.length_mm());
  const Vector3d onward = crossbar.TangentAt(crossbar.length_mm());
  crossbar.Arc(kChildBend, kChildTurn, child_side).Line(kChild);
  ArcLinePath child(fork, onward);
  child.Arc(kChildBend, kChildTurn, -child_side).Line(kChild);
  constexpr double kInside = 4;
  ArcLinePath child_lumen(child.PointAt(kInside), child.TangentAt(kInside));
  child_lumen.Arc(kChildBend, kChildTurn - kInside / kChildBend, -child_side).Line(kChild);

  TubeVessel vessel;
  vessel.field =
      std::make_unique<TubeField>(std::vector<Tube>{{"stem", stem, {kRadius}, {}},
                                                    {"crossbar", crossbar, {kRadius}, {}},
                                                    {"child", child_lumen, {kRadius}, {}}},
                                  kUnionWidth);
  vessel.bounds_mm = vessel.field->bounds_mm();

  // The main path and the side branch share the stem and round the corner with different bends.
  constexpr double kCorner = 6;
  const double setback = kCorner * std::tan(37.5 * kDegree);
  ArcLinePath main(Vector3d::Zero(), Vector3d::UnitX());
  main.Line(kStem - setback)
      .Arc(kCorner, 75 * kDegree, across)
      .Line(kBefore - setback)
      .Arc(kBend, 30 * kDegree, out_of_plane)
      .Line(kAfter)
      .Arc(kChildBend, kChildTurn, child_side)
      .Line(kChild);
  ArcLinePath side(Vector3d(kStem - setback, 0, 0), Vector3d::UnitX());
  side.Arc(setback / std::tan(52.5 * kDegree), 105 * kDegree, -across).Line(kSide - setback);
  std::vector<Centerline> curves;
  curves.push_back(CenterlineOf({"main", main, {kRadius}, {}}));
  curves.push_back(CenterlineOf({"side", side, {kRadius}, {}}));
  curves.push_back(CenterlineOf({"child", child, {kRadius}, {}}));
  vessel.centerlines = CenterlineNetwork(std::move(curves));
  return vessel;
}

std::shared_ptr<const BrickField> MakeTubeBricks(std::shared_ptr<const TubeField> field,
                                                 std::optional<double> voxel_mm) {
  constexpr double kLeastVoxel_mm = 0.02;
  // A narrower band would reach less far than the bulges of a step; a wider one costs memory.
  constexpr double kBand_mm = 1;
  BrickFieldOptions options;
  options.voxel_mm = voxel_mm.value_or(
      std::clamp(field->smallest_radius_mm() / 3, kLeastVoxel_mm, options.voxel_mm));
  options.band_mm = kBand_mm;
  const Eigen::AlignedBox3d bounds_mm = field->bounds_mm();
  return std::make_shared<const BrickField>(std::move(field), bounds_mm, options);
}

Vessel FromTubes(TubeVessel tubes, std::string description) {
  Vessel vessel;
  vessel.field = std::move(tubes.field);
  vessel.centerlines = std::move(tubes.centerlines);
  vessel.bounds_mm = tubes.bounds_mm;
  vessel.description = std::move(description);
  return vessel;
}

}  // namespace torquer::vessel
