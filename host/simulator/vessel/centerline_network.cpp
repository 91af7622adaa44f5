#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <sstream>

#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/curve_limits.h"
#include "host/simulator/vessel/route.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

std::string Millimeters(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

// Largest compared length of a name: the time grows with the product of the lengths.
constexpr size_t kMostCompared = 200;

// Number of edits that turn one name into another.
size_t EditDistance(const std::string& whole_a, const std::string& whole_b) {
  const std::string a = whole_a.substr(0, kMostCompared), b = whole_b.substr(0, kMostCompared);
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row[b.size()];
}

bool IsShortFor(const std::string& brief, const std::string& name) {
  if (brief.empty() || name.size() <= brief.size()) return false;
  if (name.find("(" + brief + ")") != std::string::npos) return true;
  return name.compare(name.size() - brief.size() - 1, std::string::npos, " " + brief) == 0;
}

void CheckLimits(const std::vector<Centerline>& curves) {
  double length_mm = 0;
  for (const Centerline& curve : curves) length_mm += curve.length_mm();
  // Written so that NaN fails.
  if (curves.size() <= kMostCurves && length_mm <= kMostCurvesMm) return;
  throw UserError(std::to_string(curves.size()) + " centerlines of " + Millimeters(length_mm) +
                  " mm in all; a vessel has at most " + std::to_string(kMostCurves) + " of " +
                  Millimeters(kMostCurvesMm) +
                  " mm: check their unit, or remove unused centerlines");
}

// Box of a curve's points. It contains the chords that Centerline::NearestTo searches.
Eigen::AlignedBox3d BoundsOf(const Centerline& curve) {
  Eigen::AlignedBox3d box;
  for (const Vector3d& point : curve.points_mm()) box.extend(point);
  return box;
}

}  // namespace

CenterlineNetwork::CenterlineNetwork(std::vector<Centerline> curves, double join_tolerance_mm)
    : curves_(std::move(curves)) {
  constexpr size_t kNone = std::numeric_limits<size_t>::max();
  // Joints of each curve with their places; one joint can have a place on every curve.
  std::vector<std::vector<std::pair<double, size_t>>> joints_of(curves_.size());
  // Finds the first joint at a place; with `wanted`, that joint only.
  const auto find_joint = [&](const CenterlinePlace& place, size_t wanted) {
    size_t found = kNone;
    for (const auto& [s_mm, joint] : joints_of[place.curve]) {
      if (std::abs(s_mm - place.s_mm) > join_tolerance_mm + 1e-9) continue;
      if (joint == wanted) return joint;
      if (wanted == kNone) found = std::min(found, joint);
    }
    return found;
  };
  const auto add = [&](size_t joint, const CenterlinePlace& place) {
    if (find_joint(place, joint) != kNone) return;
    joints_[joint].places.push_back(place);
    joints_of[place.curve].emplace_back(place.s_mm, joint);
  };
  CheckLimits(curves_);
  std::vector<Eigen::AlignedBox3d> boxes;
  for (const Centerline& curve : curves_) boxes.push_back(BoundsOf(curve));
  for (size_t i = 0; i < curves_.size(); ++i) {
    for (const double s : {0.0, curves_[i].length_mm()}) {
      const Vector3d end = curves_[i].At(s).position_mm;
      for (size_t j = 0; j < curves_.size(); ++j) {
        if (i == j || boxes[j].exteriorDistance(end) > join_tolerance_mm + 1e-9) continue;
        Centerline::Nearest nearest = curves_[j].NearestTo(end);
        if (nearest.distance_mm > join_tolerance_mm) continue;
        // A place near an end counts as the end itself.
        if (nearest.s_mm < join_tolerance_mm) nearest.s_mm = 0;
        if (nearest.s_mm > curves_[j].length_mm() - join_tolerance_mm) {
          nearest.s_mm = curves_[j].length_mm();
        }
        const CenterlinePlace here{i, s}, there{j, nearest.s_mm};
        size_t joint = std::min(find_joint(here, kNone), find_joint(there, kNone));
        if (joint == kNone) {
          joint = joints_.size();
          joints_.push_back({end, {}});
        }
        add(joint, here);
        add(joint, there);
      }
    }
  }
}

size_t CenterlineNetwork::Find(const std::string& name) const {
  std::vector<size_t> candidates;
  for (size_t i = 0; i < curves_.size(); ++i) {
    if (curves_[i].name() == name) return i;
    if (IsShortFor(name, curves_[i].name())) candidates.push_back(i);
  }
  if (candidates.size() == 1) return candidates.front();
  std::vector<std::pair<size_t, size_t>> near;
  for (size_t i = 0; i < curves_.size(); ++i) {
    near.emplace_back(EditDistance(name, curves_[i].name()), i);
  }
  std::sort(near.begin(), near.end());
  std::string text = candidates.empty() ? "no centerline is called \"" + Printable(name) + "\""
                                        : "several centerlines match \"" + Printable(name) + "\"";
  if (near.empty()) throw UserError(text + "; the vessel has no centerlines");
  text += "; the nearest names are";
  for (size_t i = 0; i < std::min<size_t>(3, near.size()); ++i) {
    text += (i ? ", \"" : " \"") + Printable(curves_[near[i].second].name()) + "\"";
  }
  throw UserError(text);
}

CenterlinePlace CenterlineNetwork::Place(const std::string& curve, const std::string& end) const {
  const size_t index = Find(curve);
  if (end == "start") return {index, 0};
  if (end == "end") return {index, curves_[index].length_mm()};
  throw UserError("\"" + Printable(end) + "\" is not an end of centerline \"" + curve +
                  "\"; give \"start\" or \"end\"");
}

CenterlinePlace CenterlineNetwork::Place(const std::string& curve, double s_mm) const {
  const size_t index = Find(curve);
  if (!(s_mm >= 0 && s_mm <= curves_[index].length_mm())) {
    throw UserError("centerline \"" + curves_[index].name() + "\" has no place at " +
                    Millimeters(s_mm) + " mm; give 0 to " +
                    Millimeters(curves_[index].length_mm()));
  }
  return {index, s_mm};
}

CenterlinePlace CenterlineNetwork::NearestTo(const Vector3d& point_mm, double* distance_mm) const {
  CenterlinePlace place;
  double best = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < curves_.size(); ++i) {
    const Centerline::Nearest nearest = curves_[i].NearestTo(point_mm);
    if (nearest.distance_mm < best) {
      best = nearest.distance_mm;
      place = {i, nearest.s_mm};
    }
  }
  if (distance_mm != nullptr) *distance_mm = best;
  return place;
}

CenterlineSample CenterlineNetwork::At(const CenterlinePlace& place) const {
  assert(place.curve < curves_.size());
  return curves_[place.curve].At(place.s_mm);
}

Centerline CenterlineNetwork::Path(const CenterlinePlace& from, const CenterlinePlace& to) const {
  assert(from.curve < curves_.size() && to.curve < curves_.size());
  const Route route = FindRoute(*this, from, to);
  const auto describe = [&](const CenterlinePlace& place) {
    return "\"" + curves_[place.curve].name() + "\" at " + Millimeters(place.s_mm) + " mm";
  };
  if (!route.connected) {
    throw UserError("no connected route along the centerlines from " + describe(from) + " to " +
                    describe(to) +
                    "; the curves between them do not meet: choose two connected places");
  }
  if (route.length_mm < 1e-3) {
    throw UserError("the route from " + describe(from) + " to " + describe(to) +
                    " has no length; choose two different places");
  }
  std::vector<Vector3d> points;
  std::vector<double> radii;
  for (const RouteLeg& leg : route.legs) {
    const Centerline part = curves_[leg.curve].Part(leg.from_mm, leg.to_mm, "part");
    for (size_t i = 0; i < part.points_mm().size(); ++i) {
      // Joined curves can be slightly apart; the corner between them then lies on the second one.
      if (i == 0 && !points.empty()) {
        points.pop_back();
        radii.pop_back();
      }
      points.push_back(part.points_mm()[i]);
      radii.push_back(part.radii_mm()[i]);
    }
  }
  return Centerline(curves_[from.curve].name() + " to " + curves_[to.curve].name(), points, radii);
}

CenteredCurve CenteredInLumen(const Centerline& curve, const ClearanceField& field,
                              double reach_mm) {
  constexpr double kStepMm = 1;
  constexpr int kRounds = 120;
  constexpr double kPush = 0.15, kLeastClearanceMm = 0.25, kRoomMm = 1;
  const auto steps =
      std::max<size_t>(4, static_cast<size_t>(std::ceil(curve.length_mm() / kStepMm)));
  std::vector<Vector3d> start, points;
  for (size_t i = 0; i <= steps; ++i) {
    start.push_back(
        curve.At(curve.length_mm() * static_cast<double>(i) / static_cast<double>(steps))
            .position_mm);
  }
  points = start;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Vector3d> next = points;
    for (size_t i = 0; i <= steps; ++i) {
      const size_t before = i == 0 ? 0 : i - 1, after = std::min(i + 1, steps);
      const Vector3d tangent = (points[after] - points[before]).normalized();
      ClearanceSample sample;
      field.EvaluateGradient(points[i], sample);
      // If there is room, the push fades out; otherwise points would oscillate across the ridge.
      const bool has_room = sample.clearance_mm > kRoomMm;
      Vector3d push = (has_room ? kPush * (1 - (round + 1.0) / kRounds) : kPush) * sample.gradient;
      if (i > 0 && i < steps) push += 0.4 * ((points[before] + points[after]) / 2 - points[i]);
      next[i] += push - push.dot(tangent) * tangent;
      const Vector3d shift = next[i] - start[i];
      if (shift.norm() > reach_mm) next[i] = start[i] + reach_mm / shift.norm() * shift;
    }
    points = std::move(next);
  }
  std::vector<double> clearance;
  for (const Vector3d& point : points) clearance.push_back(field.Clearance(point));
  size_t first = 0, last = steps;
  while (first < last && clearance[first] < kLeastClearanceMm) ++first;
  while (last > first && clearance[last] < kLeastClearanceMm) --last;
  if (last < first + 2) {
    throw UserError("centerline \"" + curve.name() +
                    "\" does not run in the lumen; check that it belongs to this surface");
  }
  double largest_shift = 0;
  for (size_t i = first; i <= last; ++i) {
    if (clearance[i] <= 0) {
      std::ostringstream text;
      text << "centerline \"" << curve.name() << "\" leaves the lumen at (" << points[i].transpose()
           << ") mm, " << -clearance[i]
           << " mm outside the wall, and cannot be centered; choose another route or repair the "
              "surface";
      throw UserError(text.str());
    }
    largest_shift = std::max(largest_shift, (points[i] - start[i]).norm());
  }
  const auto from = static_cast<std::ptrdiff_t>(first), to = static_cast<std::ptrdiff_t>(last) + 1;
  const double step = curve.length_mm() / static_cast<double>(steps);
  return {Centerline(curve.name(), {points.begin() + from, points.begin() + to},
                     {clearance.begin() + from, clearance.begin() + to}),
          largest_shift, static_cast<double>(first) * step,
          static_cast<double>(steps - last) * step};
}

namespace {

// Arc length of the wall between one inside the lumen and one outside it, mm.
template <class Clearance>
double WallBetween(double inside_mm, double outside_mm, const Clearance& clearance_at) {
  constexpr double kExactMm = 0.01;
  while (std::abs(outside_mm - inside_mm) > kExactMm) {
    const double middle_mm = (inside_mm + outside_mm) / 2;
    (clearance_at(middle_mm) > 0 ? inside_mm : outside_mm) = middle_mm;
  }
  return outside_mm;
}

}  // namespace

std::vector<OutsideStretch> FindStretchesOutside(const CenterlineNetwork& network,
                                                 const DistanceSource& surface, double step_mm) {
  std::vector<OutsideStretch> stretches;
  for (const Centerline& curve : network.curves()) {
    bool outside = false;
    const int steps = std::max(1, static_cast<int>(std::ceil(curve.length_mm() / step_mm)));
    const auto clearance_at = [&](double s) { return surface.Distance(curve.At(s).position_mm); };
    for (int i = 0; i <= steps; ++i) {
      const double s = curve.length_mm() * i / steps;
      const double before = curve.length_mm() * std::max(i - 1, 0) / steps;
      const double clearance = clearance_at(s);
      if (clearance > 0) {
        if (outside) stretches.back().to_mm = WallBetween(s, before, clearance_at);
        outside = false;
        continue;
      }
      if (!outside) {
        const double from_mm = i == 0 ? 0 : WallBetween(before, s, clearance_at);
        stretches.push_back({curve.name(), from_mm, s, clearance});
      }
      outside = true;
      stretches.back().to_mm = s;
      stretches.back().worst_clearance_mm =
          std::min(stretches.back().worst_clearance_mm, clearance);
    }
  }
  return stretches;
}

}  // namespace torquer::vessel
