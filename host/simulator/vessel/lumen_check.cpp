#include "host/simulator/vessel/lumen_check.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "host/simulator/vessel/mesh_repair.h"

namespace torquer::vessel {

using Eigen::Vector3d;
using repair::Number;
using repair::Place;

namespace {

constexpr double kLongestWayMm = 100, kLeastWayMm = 1;

// Nearest place on a centerline, or else a place up the clearance, with room for the wire. NaN
// without such a place.
Vector3d Suggest(const ClearanceField& field, const CenterlineNetwork& centerlines,
                 const Vector3d& point_mm, double wire_radius_mm) {
  if (!centerlines.empty()) {
    Vector3d at = centerlines.At(centerlines.NearestTo(point_mm)).position_mm;
    if (field.Clearance(at) > wire_radius_mm) return at;
  }
  Vector3d at = point_mm;
  ClearanceSample sample;
  for (int step = 0; step < 200; ++step) {
    field.EvaluateGradient(at, sample);
    if (sample.clearance_mm > 1.5 * wire_radius_mm) return at;
    const double slope = sample.gradient.norm();
    if (!(slope > 1e-3)) break;
    const double length = std::max(0.1, 1.6 * wire_radius_mm - sample.clearance_mm);
    at += length / slope * sample.gradient;
  }
  return Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
}

}  // namespace

LumenReport CheckPlace(const ClearanceField& field, const CenterlineNetwork& centerlines,
                       const Vector3d& point_mm, const Vector3d& direction, double wire_radius_mm) {
  LumenReport report;
  report.suggestion_mm = point_mm;
  report.clearance_mm = field.Clearance(point_mm);
  report.inside = report.clearance_mm > 0;
  report.wire_fits = report.clearance_mm > wire_radius_mm;
  if (report.wire_fits) {
    while (report.free_way_mm < kLongestWayMm) {
      const double room =
          field.Clearance(point_mm + report.free_way_mm * direction) - wire_radius_mm;
      if (room <= 1e-3) break;
      report.free_way_mm += room / field.LipschitzBound();
    }
    report.free_way_mm = std::min(report.free_way_mm, kLongestWayMm);
    if (report.free_way_mm >= kLeastWayMm) return report;
    report.problem = "the direction leads into the wall after " + Number(report.free_way_mm) +
                     " mm; turn it along the vessel";
    return report;
  }
  report.suggestion_mm = Suggest(field, centerlines, point_mm, wire_radius_mm);
  const std::string remedy =
      report.suggestion_mm.allFinite()
          ? "the wire would fit at " + Place(report.suggestion_mm)
          : "no place nearby is wide enough: use a thinner wire or enter elsewhere";
  if (!report.inside) {
    report.problem = Place(point_mm) + " lies " + Number(-report.clearance_mm) +
                     " mm outside the lumen; " + remedy;
  } else {
    report.problem = "at " + Place(point_mm) + " the wall is " + Number(report.clearance_mm) +
                     " mm away, so a wire of radius " + Number(wire_radius_mm) +
                     " mm does not fit; " + remedy;
  }
  return report;
}

SharesInside FindSharesInside(const CenterlineNetwork& network, const DistanceSource& surface) {
  SharesInside inside;
  double points = 0;
  for (const Centerline& curve : network.curves()) {
    for (double s_mm = 0; s_mm <= curve.length_mm(); s_mm += 1) {
      const Vector3d at = curve.At(s_mm).position_mm;
      ++points;
      inside.as_given += surface.Distance(at) > 0 ? 1 : 0;
      inside.turned += surface.Distance({-at.x(), -at.y(), at.z()}) > 0 ? 1 : 0;
    }
  }
  inside.as_given /= std::max(points, 1.0);
  inside.turned /= std::max(points, 1.0);
  return inside;
}

std::optional<WrongRadius> FindWrongRadius(const CenterlineNetwork& network,
                                           const DistanceSource& surface) {
  constexpr double kFactor = 5;
  constexpr std::size_t kLeastPoints = 20;
  WrongRadius largest;
  std::vector<double> shares;  // radii over distances to the wall
  for (const Centerline& curve : network.curves()) {
    for (double s_mm = 0; s_mm <= curve.length_mm(); s_mm += 1) {
      const CenterlineSample at = curve.At(s_mm);
      const double room_mm = surface.Distance(at.position_mm);
      if (room_mm <= 0) continue;
      largest.room_mm = std::max(largest.room_mm, room_mm);
      shares.push_back(at.radius_mm / room_mm);
      if (at.radius_mm <= largest.radius_mm) continue;
      largest.curve = curve.name();
      largest.at_mm = s_mm;
      largest.position_mm = at.position_mm;
      largest.radius_mm = at.radius_mm;
    }
  }
  if (shares.size() < kLeastPoints) return std::nullopt;
  const auto middle = shares.begin() + static_cast<std::ptrdiff_t>(shares.size() / 2);
  std::nth_element(shares.begin(), middle, shares.end());
  largest.is_too_large = largest.radius_mm > kFactor * largest.room_mm;
  if (!largest.is_too_large && *middle >= 1 / kFactor) return std::nullopt;
  return largest;
}

}  // namespace torquer::vessel
