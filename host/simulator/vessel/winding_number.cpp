// Winding numbers of a mesh, by its tree of boxes.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "host/simulator/vessel/triangle_bvh.h"

namespace torquer::vessel {

using Eigen::Vector3d;

namespace {

// Nodes further away than this many times their reach count as one dipole.
constexpr double kDipoleRatio = 3;
// The same for winding numbers that are rounded: they are then wrong by a few hundredths.
constexpr double kCoarseDipoleRatio = 2;
// Largest distance from an integer at which a coarse winding number is rounded.
constexpr double kMostFractional = 0.35;
// Things further away than this many steps look the same from both sides of a face.
constexpr double kFarSteps = 100;

double SolidAngle(const Vector3d& a, const Vector3d& b, const Vector3d& c) {
  // Van Oosterom & Strackee (1983).
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2 * std::atan2(a.dot(b.cross(c)),
                        la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

double TriangleBvh::WindingNumber(const Vector3d& point_mm) const {
  double sum = 0;
  const auto enters = [&](const Node& node) {
    const Vector3d d = node.place - point_mm;
    const double distance = d.norm();
    if (distance <= kDipoleRatio * node.reach) return true;
    sum += node.area.dot(d) / (distance * distance * distance);
    return false;
  };
  Walk(enters, [&](int32_t triangle) {
    const Face& face = faces_[triangle];
    const Vector3d a = face.a - point_mm;
    sum += SolidAngle(a, a + face.ab, a + face.ac);
    return true;
  });
  return sum / (4 * M_PI);
}

std::pair<double, double> TriangleBvh::WindingNumbersBeside(const Vector3d& point_mm,
                                                            const Vector3d& step_mm,
                                                            double dipole_ratio) const {
  double common = 0, outer = 0, inner = 0;
  const double far_mm = kFarSteps * step_mm.norm();
  const auto enters = [&](const Node& node) {
    const Vector3d d = node.place - point_mm;
    const double squared = d.squaredNorm(), near = dipole_ratio * node.reach + far_mm;
    if (squared <= near * near) return true;
    common += node.area.dot(d) / (squared * std::sqrt(squared));
    return false;
  };
  Walk(enters, [&](int32_t triangle) {
    const Face& face = faces_[triangle];
    const auto angle_from = [&face](const Vector3d& from) {
      const Vector3d a = face.a - from;
      return SolidAngle(a, a + face.ab, a + face.ac);
    };
    const double reach = std::sqrt(std::max(face.ab_ab, face.ac_ac)) + far_mm;
    if ((face.a - point_mm).squaredNorm() > reach * reach) {
      common += angle_from(point_mm);
    } else {
      outer += angle_from(point_mm + step_mm);
      inner += angle_from(point_mm - step_mm);
    }
    return true;
  });
  return {(common + outer) / (4 * M_PI), (common + inner) / (4 * M_PI)};
}

TriangleBvh::WholeSides TriangleBvh::WholeWindingNumbers(const Vector3d& point_mm,
                                                         const Vector3d& step_mm) const {
  const auto fraction = [](double number) { return std::abs(number - std::round(number)); };
  auto sides = WindingNumbersBeside(point_mm, step_mm, kCoarseDipoleRatio);
  if (fraction(sides.first) > kMostFractional || fraction(sides.second) > kMostFractional) {
    sides = {WindingNumber(point_mm + step_mm), WindingNumber(point_mm - step_mm)};
  }
  return {std::lround(sides.first), std::lround(sides.second)};
}

}  // namespace torquer::vessel
