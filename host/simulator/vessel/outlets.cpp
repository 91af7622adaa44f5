#include "host/simulator/vessel/outlets.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/vessel/flat_ends.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

// A curve's end is an outlet if the lumen ends within this many radii behind it. No other outlet
// may lie there.
constexpr double kEndsWithinRadii = 3;
constexpr double kSamePlaceMm = 1e-3;

std::vector<Outlet> OutletsOf(const std::vector<Opening>& openings) {
  std::vector<Outlet> outlets;
  for (const Opening& opening : openings) {
    outlets.push_back({opening.center_mm, -opening.inward, opening.radius_mm});
  }
  return outlets;
}

bool IsJoined(const CenterlineNetwork& network, std::size_t curve, double s_mm) {
  const auto is_here = [&](const CenterlinePlace& place) {
    return place.curve == curve && std::abs(place.s_mm - s_mm) < kSamePlaceMm;
  };
  return std::any_of(network.joints().begin(), network.joints().end(), [&](const auto& joint) {
    return std::any_of(joint.places.begin(), joint.places.end(), is_here);
  });
}

void AddFreeEnds(const Vessel& vessel, std::vector<Outlet>& outlets) {
  const CenterlineNetwork& network = vessel.centerlines;
  for (std::size_t k = 0; k < network.curves().size(); ++k) {
    const Centerline& curve = network.curves()[k];
    for (const double s_mm : {0.0, curve.length_mm()}) {
      if (IsJoined(network, k, s_mm)) continue;
      const CenterlineSample end = curve.At(s_mm);
      const Vector3d outward = s_mm > 0 ? end.tangent : Vector3d(-end.tangent);
      const double near_mm = kEndsWithinRadii * end.radius_mm;
      if (vessel.field->Clearance(end.position_mm + near_mm * outward) >= 0) continue;
      const auto is_near = [&](const Outlet& other) {
        return other.DistanceMm(end.position_mm) <= near_mm;
      };
      if (std::any_of(outlets.begin(), outlets.end(), is_near)) continue;
      outlets.push_back({end.position_mm, outward, end.radius_mm});
    }
  }
}

}  // namespace

double Outlet::DistanceMm(const Vector3d& point_mm) const {
  const Vector3d off = point_mm - center_mm;
  const double along = off.dot(outward);
  const double beside = std::max(0.0, (off - along * outward).norm() - radius_mm);
  return std::hypot(along, beside);
}

std::vector<Outlet> FindOutlets(const Vessel& vessel) {
  std::vector<Outlet> outlets;
  if (vessel.surface != nullptr) {
    outlets = OutletsOf(vessel.surface->report().openings);
    if (outlets.empty()) outlets = OutletsOf(FindFlatEnds(vessel.surface->mesh()));
  }
  AddFreeEnds(vessel, outlets);
  return outlets;
}

}  // namespace torquer::vessel
