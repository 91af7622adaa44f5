#include "host/simulator/effects/region_keys.h"

#include <cmath>

#include "host/support/error.h"

namespace torquer::effects {

using Eigen::Vector3d;
using vessel::Region;

namespace {

constexpr double kSmallestRadiusMm = 0.1;
constexpr double kLargestRadiusMm = 1e4;
constexpr double kSmallestEdgeMm = 0.01;
constexpr double kLargestEdgeMm = 1000;

Region ReadStretch(StrictTable& keys, const EffectContext& context) {
  const std::string name = keys.Text("centerline");
  if (context.centerlines == nullptr || context.centerlines->empty()) {
    keys.Refuse("centerline", "this vessel has no centerlines; give center_mm and radius_mm");
  }
  std::size_t index = 0;
  try {
    index = context.centerlines->Find(name);
  } catch (const UserError& error) {
    keys.Refuse("centerline", error.what());
  }
  const vessel::Centerline& curve = context.centerlines->curves()[index];
  const double length = curve.length_mm();
  const double from = keys.Number("from_mm", 0, length, 0);
  const double to = keys.Number("to_mm", 0, length, length);
  if (!(to > from)) keys.Refuse("to_mm", "must be more than from_mm");
  const double radius = keys.Number("radius_mm", kSmallestRadiusMm, kLargestRadiusMm);
  return Region::Stretch(curve, from, to, radius,
                         keys.Number("edge_mm", kSmallestEdgeMm, kLargestEdgeMm, radius / 2));
}

Region ReadOne(StrictTable& keys, const EffectContext& context) {
  if (keys.Has("centerline")) return ReadStretch(keys, context);
  if (keys.Has("side_of_mm")) {
    const Vector3d point = keys.Point("side_of_mm");
    const Vector3d direction = ReadPatientDirection(keys, "side", context);
    return Region::Side(point, direction, keys.Number("edge_mm", kSmallestEdgeMm, kLargestEdgeMm));
  }
  if (!keys.Has("center_mm")) {
    keys.Refuse("center_mm",
                "is missing; give center_mm and radius_mm, or centerline and radius_mm, or "
                "side_of_mm and side");
  }
  const Vector3d center = keys.Point("center_mm");
  const double radius = keys.Number("radius_mm", kSmallestRadiusMm, kLargestRadiusMm);
  return Region::Ball(center, radius,
                      keys.Number("edge_mm", kSmallestEdgeMm, kLargestEdgeMm, radius / 2));
}

}  // namespace

Region ReadRegion(StrictTable& keys, const EffectContext& context) {
  Region region = ReadOne(keys, context);
  if (context.field != nullptr && context.centerlines != nullptr &&
      !region.MeetsLumen(*context.field, *context.centerlines, context.bounds_mm)) {
    const char* key = keys.Has("centerline")   ? "centerline"
                      : keys.Has("side_of_mm") ? "side_of_mm"
                                               : "center_mm";
    keys.Refuse(key,
                "this region meets no part of the vessel's lumen; move it there, make it larger "
                "or remove it");
  }
  return region;
}

std::vector<OtherKey> RegionKeys(const std::vector<OtherKey>& more) {
  std::vector<OtherKey> all = {
      {"region", "list of tables",
       "parts of the vessel, each a ball (center_mm, radius_mm), a stretch (centerline, from_mm, "
       "to_mm, radius_mm) or a side of a plane (side_of_mm, side)"},
      {"region.center_mm", "[x, y, z], mm", "middle of a ball"},
      {"region.radius_mm", "0.1 to 10000 mm", "of a ball, or about a stretch"},
      {"region.centerline", "text", "name of the curve of a stretch"},
      {"region.from_mm", "mm, if not given 0", "where the stretch begins, by arc length"},
      {"region.to_mm", "mm, if not given the curve's end", "where it ends"},
      {"region.side_of_mm", "[x, y, z], mm", "a point of the plane"},
      {"region.side", "[x, y, z] or left, right, anterior, posterior, superior, inferior",
       "the side of the plane"},
      {"region.edge_mm", "0.01 to 1000 mm, if not given half the radius",
       "how far outside of it the region fades"}};
  all.insert(all.end(), more.begin(), more.end());
  return all;
}

Vector3d ReadPatientDirection(StrictTable& keys, const char* key, const EffectContext& context) {
  static const std::vector<std::string> names = {"left",     "right",    "posterior",
                                                 "anterior", "superior", "inferior"};
  if (keys.IsText(key)) {
    const vessel::PatientAxes& axes = context.axes;
    const Vector3d towards[] = {axes.left, axes.posterior, axes.superior};
    const int choice = keys.Choice(key, names);
    return choice % 2 == 0 ? towards[choice / 2] : Vector3d(-towards[choice / 2]);
  }
  const Vector3d direction = keys.Point(key);
  if (!(direction.norm() > 1e-9)) keys.Refuse(key, "has no length");
  return direction.normalized();
}

}  // namespace torquer::effects
