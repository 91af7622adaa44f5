#include "host/simulator/vessel/region.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/vessel/smooth_step.h"

namespace torquer::vessel {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Balls of this many radii, half a radius apart, contain the tube of one radius.
constexpr double kWidened = 1.035;
constexpr std::size_t kGroup = 12;

}  // namespace

Region Region::Ball(const Vector3d& center_mm, double radius_mm, double edge_mm) {
  Region region(radius_mm, edge_mm);
  region.centers_.push_back(center_mm);
  region.Group();
  return region;
}

Region Region::Stretch(const Centerline& curve, double from_mm, double to_mm, double radius_mm,
                       double edge_mm) {
  Region region(kWidened * radius_mm, edge_mm);
  const int steps = std::max(1, static_cast<int>(std::ceil((to_mm - from_mm) / (radius_mm / 2))));
  for (int k = 0; k <= steps; ++k) {
    region.centers_.push_back(curve.At(from_mm + (to_mm - from_mm) * k / steps).position_mm);
  }
  const double outer = region.OuterMm();
  for (const Vector3d& a : region.centers_) {
    // All balls that can overlap with this one.
    const auto overlapping =
        std::count_if(region.centers_.begin(), region.centers_.end(),
                      [&](const Vector3d& b) { return (a - b).norm() < 2 * outer; });
    region.most_overlapping_ = std::max(region.most_overlapping_, static_cast<int>(overlapping));
  }
  region.Group();
  return region;
}

Region Region::Side(const Vector3d& point_mm, const Vector3d& direction, double edge_mm) {
  Region region(0, edge_mm);
  region.point_ = point_mm;
  region.direction_ = direction;
  return region;
}

void Region::Group() {
  for (std::size_t first = 0; first < centers_.size(); first += kGroup) {
    BallGroup group{.first = first, .end = std::min(first + kGroup, centers_.size())};
    for (std::size_t k = group.first; k < group.end; ++k) group.center += centers_[k];
    group.center /= static_cast<double>(group.end - group.first);
    for (std::size_t k = group.first; k < group.end; ++k) {
      group.reach_mm = std::max(group.reach_mm, (centers_[k] - group.center).norm());
    }
    group.reach_mm += OuterMm();
    groups_.push_back(group);
  }
}

double Region::Weight(const Vector3d& point_mm) const {
  if (centers_.empty()) return SmoothStep((point_mm - point_).dot(direction_) / edge_mm_).value;
  return WeightAmong(groups_, point_mm);
}

double Region::WeightAmong(const std::vector<BallGroup>& groups, const Vector3d& point_mm) const {
  const double outer = OuterMm();
  double rest = 1;
  for (const BallGroup& group : groups) {
    if ((point_mm - group.center).squaredNorm() >= group.reach_mm * group.reach_mm) continue;
    for (std::size_t k = group.first; k < group.end; ++k) {
      const double squared = (point_mm - centers_[k]).squaredNorm();
      if (squared >= outer * outer) continue;
      if (squared <= radius_mm_ * radius_mm_) return 1;
      rest *= 1 - SmoothStep((outer - std::sqrt(squared)) / edge_mm_).value;
    }
  }
  return 1 - rest;
}

bool Region::Evaluate(const Vector3d& point_mm, RegionWeight& out) const {
  if (centers_.empty()) {
    const Step step = SmoothStep((point_mm - point_).dot(direction_) / edge_mm_);
    if (step.value == 0) return false;
    out.value = step.value;
    out.gradient = (step.slope / edge_mm_) * direction_;
    out.hessian = (step.curvature / (edge_mm_ * edge_mm_)) * direction_ * direction_.transpose();
    return true;
  }
  // 1 - weight is the product of 1 - step over the balls.
  const double outer = OuterMm();
  double rest = 1;
  Vector3d gradient = Vector3d::Zero();
  Matrix3d hessian = Matrix3d::Zero();
  bool any = false;
  for (const BallGroup& group : groups_) {
    if ((point_mm - group.center).squaredNorm() >= group.reach_mm * group.reach_mm) continue;
    for (std::size_t k = group.first; k < group.end; ++k) {
      const Vector3d from = point_mm - centers_[k];
      const double squared = from.squaredNorm();
      if (squared >= outer * outer) continue;
      if (squared <= radius_mm_ * radius_mm_) {
        out = RegionWeight();
        out.value = 1;
        return true;
      }
      const double distance = std::sqrt(squared);
      const Step step = SmoothStep((outer - distance) / edge_mm_);
      const Vector3d outward = from / distance;
      const double left = 1 - step.value;
      const double slope = step.slope / edge_mm_;
      const Vector3d g = slope * outward;
      Matrix3d h = (slope / distance) * Matrix3d::Identity();
      h -= (step.curvature / (edge_mm_ * edge_mm_) + slope / distance) * outward *
           outward.transpose();
      hessian = left * hessian + gradient * g.transpose() + g * gradient.transpose() + rest * h;
      gradient = left * gradient + rest * g;
      rest *= left;
      any = true;
    }
  }
  if (!any) return false;
  out.value = 1 - rest;
  out.gradient = -gradient;
  out.hessian = -hessian;
  return true;
}

double Region::SteepestSlope() const {
  // For N overlapping balls, the sum of s(w) (1 - w)^(N-1) is at most 2.53 N^(1/3). The slope of a
  // step at its value w is s(w) ~ 6.46 w^(2/3).
  const double overlap = most_overlapping_ == 1
                             ? kSteepestStep
                             : std::max(kSteepestStep, 2.53 * std::cbrt(most_overlapping_));
  return overlap / edge_mm_;
}

namespace {

constexpr int kPerAxis = 24;  // intervals of a grid

// Calls found(point) on a grid until it returns true; returns that.
template <class Found>
bool FindOnGrid(const Vector3d& low, const Vector3d& size, const Found& found) {
  for (int x = 0; x <= kPerAxis; ++x) {
    for (int y = 0; y <= kPerAxis; ++y) {
      for (int z = 0; z <= kPerAxis; ++z) {
        if (found(low + Vector3d(x, y, z).cwiseProduct(size) / kPerAxis)) return true;
      }
    }
  }
  return false;
}

}  // namespace

// Searches a grid in the ball, except in the ball before it, and compares only with groups near the
// ball. So the work for each ball does not grow with the number of balls.
bool Region::BallMeetsLumen(std::size_t ball, const ClearanceField& field,
                            std::int64_t& comparisons) const {
  const Vector3d& center = centers_[ball];
  const double outer = OuterMm();
  if (field.Clearance(center) < -field.LipschitzBound() * outer) return false;
  std::vector<BallGroup> near;
  for (const BallGroup& group : groups_) {
    if ((center - group.center).norm() < group.reach_mm + outer) near.push_back(group);
  }
  const auto is_in = [&](const Vector3d& point) {
    if ((point - center).squaredNorm() > outer * outer) return false;
    if (ball > 0 && (point - centers_[ball - 1]).squaredNorm() <= outer * outer) return false;
    comparisons += static_cast<std::int64_t>(near.size());
    return WeightAmong(near, point) > 0.5 && field.Clearance(point) > 0;
  };
  return FindOnGrid(center - Vector3d::Constant(outer), Vector3d::Constant(2 * outer), is_in);
}

bool Region::MeetsLumen(const ClearanceField& field, const CenterlineNetwork& centerlines,
                        const Eigen::AlignedBox3d& bounds_mm, std::int64_t* comparisons) const {
  std::int64_t compared = 0;
  const auto is_in = [&](const Vector3d& point) {
    compared += static_cast<std::int64_t>(groups_.size());
    return Weight(point) > 0.5 && field.Clearance(point) > 0;
  };
  const auto search = [&] {
    Eigen::AlignedBox3d box;  // around the balls
    for (const Vector3d& center : centers_) {
      box.extend(center - Vector3d::Constant(OuterMm()));
      box.extend(center + Vector3d::Constant(OuterMm()));
    }
    for (const Centerline& curve : centerlines.curves()) {
      for (double s = 0; s <= curve.length_mm(); s += 0.5) {
        const Vector3d point = curve.At(s).position_mm;
        if ((centers_.empty() || box.contains(point)) && is_in(point)) return true;
      }
    }
    if (centers_.empty()) return FindOnGrid(bounds_mm.min(), bounds_mm.sizes(), is_in);
    for (std::size_t ball = 0; ball < centers_.size(); ++ball) {
      if (BallMeetsLumen(ball, field, compared)) return true;
    }
    return false;
  };
  const bool meets = search();
  if (comparisons != nullptr) *comparisons = compared;
  return meets;
}

}  // namespace torquer::vessel
