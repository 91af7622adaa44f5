#include "host/simulator/vessel/centerline.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <queue>
#include <sstream>

#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

constexpr double kSamePointMm = 1e-6;

[[noreturn]] void RefuseCurve(const std::string& name, const std::string& what) {
  throw UserError("centerline \"" + name + "\": " + what);
}

// Cubic Hermite piece with unit end tangents scaled by its chord: position and derivative at x in
// [0, 1].
struct Hermite {
  Vector3d position, derivative;
};

Hermite HermiteAt(const Vector3d& p0, const Vector3d& t0, const Vector3d& p1, const Vector3d& t1,
                  double x) {
  const double chord = (p1 - p0).norm();
  const Vector3d m0 = chord * t0, m1 = chord * t1;
  const Vector3d a = 2 * (p0 - p1) + m0 + m1, b = 3 * (p1 - p0) - 2 * m0 - m1;
  return {p0 + x * (m0 + x * (b + x * a)), m0 + x * (2 * b + 3 * x * a)};
}

// Length of a piece up to x, by 5-point Gauss quadrature.
double HermiteLength(const Vector3d& p0, const Vector3d& t0, const Vector3d& p1, const Vector3d& t1,
                     double x) {
  static constexpr double kNode[] = {0, 0.5384693101056831, 0.9061798459386640};
  static constexpr double kWeight[] = {0.5688888888888889, 0.4786286704993665, 0.2369268850561891};
  double sum = kWeight[0] * HermiteAt(p0, t0, p1, t1, x / 2).derivative.norm();
  for (int i = 1; i < 3; ++i) {
    for (double sign : {-1.0, 1.0}) {
      sum +=
          kWeight[i] * HermiteAt(p0, t0, p1, t1, x / 2 * (1 + sign * kNode[i])).derivative.norm();
    }
  }
  return sum * x / 2;
}

}  // namespace

Centerline::Centerline(std::string name, const std::vector<Vector3d>& points_mm,
                       const std::vector<double>& radii_mm)
    : Centerline(std::move(name), points_mm, {}, radii_mm) {}

Centerline::Centerline(std::string name, const std::vector<Vector3d>& points_mm,
                       const std::vector<Vector3d>& tangents, const std::vector<double>& radii_mm)
    : name_(std::move(name)) {
  if (radii_mm.size() != points_mm.size()) {
    RefuseCurve(name_, std::to_string(points_mm.size()) + " points but " +
                           std::to_string(radii_mm.size()) + " radii; give one radius per point");
  }
  for (size_t i = 0; i < points_mm.size(); ++i) {
    if (!points_mm[i].allFinite() || !std::isfinite(radii_mm[i]) || radii_mm[i] < 0) {
      std::ostringstream text;
      text << "point " << i << " (" << points_mm[i].transpose() << ", radius " << radii_mm[i]
           << ") is not usable; coordinates must be finite and the radius 0 or more";
      RefuseCurve(name_, text.str());
    }
    if (!points_mm_.empty() && (points_mm[i] - points_mm_.back()).norm() < kSamePointMm) continue;
    points_mm_.push_back(points_mm[i]);
    radii_mm_.push_back(radii_mm[i]);
    if (!tangents.empty()) tangents_.push_back(tangents[i].normalized());
  }
  if (points_mm_.size() < 2) {
    RefuseCurve(
        name_, std::to_string(points_mm_.size()) + " distinct point(s); a curve needs two or more");
  }
  Measure();
}

void Centerline::Measure() {
  const size_t count = points_mm_.size();
  if (tangents_.empty()) {
    // Derivative of the parabola through three neighbors, over chord lengths.
    tangents_.resize(count);
    for (size_t i = 0; i < count; ++i) {
      const size_t a = std::min(i == 0 ? 0 : i - 1, count < 3 ? 0 : count - 3);
      if (count < 3) {
        tangents_[i] = (points_mm_[1] - points_mm_[0]).normalized();
        continue;
      }
      const Vector3d d0 = points_mm_[a + 1] - points_mm_[a];
      const Vector3d d1 = points_mm_[a + 2] - points_mm_[a + 1];
      const double h0 = d0.norm(), h1 = d1.norm();
      const Vector3d second = (d1 / h1 - d0 / h0) / (h0 + h1);  // half the second derivative
      const double x = i == a ? 0 : (i == a + 1 ? h0 : h0 + h1);
      const Vector3d tangent = d0 / h0 + second * (2 * x - h0);
      tangents_[i] = tangent.norm() > 1e-6 ? tangent.normalized() : Vector3d(d1 / h1);
    }
  }
  arc_mm_.assign(1, 0);
  for (size_t i = 1; i < count; ++i) {
    arc_mm_.push_back(arc_mm_.back() + HermiteLength(points_mm_[i - 1], tangents_[i - 1],
                                                     points_mm_[i], tangents_[i], 1));
  }
}

CenterlineSample Centerline::At(double s_mm) const {
  const double s = std::clamp(s_mm, 0.0, length_mm());
  size_t i = std::upper_bound(arc_mm_.begin(), arc_mm_.end(), s) - arc_mm_.begin();
  i = std::clamp<size_t>(i, 1, arc_mm_.size() - 1);
  const Vector3d &p0 = points_mm_[i - 1], &p1 = points_mm_[i];
  const Vector3d &t0 = tangents_[i - 1], &t1 = tangents_[i];
  const double length = arc_mm_[i] - arc_mm_[i - 1];
  double x = (s - arc_mm_[i - 1]) / length;
  const double fraction = x;
  // The piece's parameter is nearly its arc length: two Newton steps suffice.
  for (int iteration = 0; iteration < 2; ++iteration) {
    const double error = HermiteLength(p0, t0, p1, t1, x) - fraction * length;
    const double speed = HermiteAt(p0, t0, p1, t1, x).derivative.norm();
    if (speed > 1e-3 * length) x = std::clamp(x - error / speed, 0.0, 1.0);
  }
  const Hermite at = HermiteAt(p0, t0, p1, t1, x);
  return {at.position, at.derivative.normalized(),
          radii_mm_[i - 1] + fraction * (radii_mm_[i] - radii_mm_[i - 1])};
}

Centerline::Nearest Centerline::NearestTo(const Vector3d& point_mm) const {
  Nearest nearest{0, std::numeric_limits<double>::infinity()};
  for (size_t i = 1; i < points_mm_.size(); ++i) {
    const Vector3d chord = points_mm_[i] - points_mm_[i - 1];
    const double x =
        std::clamp((point_mm - points_mm_[i - 1]).dot(chord) / chord.squaredNorm(), 0.0, 1.0);
    const double distance = (point_mm - points_mm_[i - 1] - x * chord).norm();
    if (distance < nearest.distance_mm) {
      nearest = {arc_mm_[i - 1] + x * (arc_mm_[i] - arc_mm_[i - 1]), distance};
    }
  }
  return nearest;
}

Centerline Centerline::Part(double from_mm, double to_mm, std::string name) const {
  const double low = std::clamp(std::min(from_mm, to_mm), 0.0, length_mm());
  const double high = std::clamp(std::max(from_mm, to_mm), 0.0, length_mm());
  std::vector<Vector3d> points, tangents;
  std::vector<double> radii;
  const auto add = [&](const CenterlineSample& sample) {
    points.push_back(sample.position_mm);
    tangents.push_back(sample.tangent);
    radii.push_back(sample.radius_mm);
  };
  add(At(low));
  for (size_t i = 0; i < arc_mm_.size(); ++i) {
    if (arc_mm_[i] <= low + kSamePointMm || arc_mm_[i] >= high - kSamePointMm) continue;
    points.push_back(points_mm_[i]);
    tangents.push_back(tangents_[i]);
    radii.push_back(radii_mm_[i]);
  }
  add(At(high));
  if (from_mm > to_mm) {
    std::reverse(points.begin(), points.end());
    std::reverse(tangents.begin(), tangents.end());
    std::reverse(radii.begin(), radii.end());
    for (Vector3d& tangent : tangents) tangent = -tangent;
  }
  return Centerline(std::move(name), points, tangents, radii);
}

}  // namespace torquer::vessel
