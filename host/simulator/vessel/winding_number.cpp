// Winding numbers of a mesh, by its tree of boxes.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
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
// Share of the product of lengths within which rounding may change the sign of a triple product.
constexpr double kRounding = 1e-12;

// Distance from the nearest integer.
double Fraction(double number) { return std::abs(number - std::round(number)); }

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
  auto sides = WindingNumbersBeside(point_mm, step_mm, kCoarseDipoleRatio);
  if (Fraction(sides.first) > kMostFractional || Fraction(sides.second) > kMostFractional) {
    sides = {WindingNumber(point_mm + step_mm), WindingNumber(point_mm - step_mm)};
  }
  return {std::lround(sides.first), std::lround(sides.second)};
}

// Winding number at the beginning of a ray: its crossings out of the surface less those into it.
std::optional<long> TriangleBvh::CrossingsOf(const Vector3d& from_mm,
                                             const Vector3d& direction) const {
  long crossings = 0;
  bool is_certain = true;
  WalkBoxesOnRay(
      from_mm, direction, 0, std::numeric_limits<double>::infinity(), [&](int32_t triangle) {
        // Moeller & Trumbore (1997), times the determinant.
        const Face& face = faces_[triangle];
        const Vector3d d = from_mm - face.a, h = direction.cross(face.ac), q = d.cross(face.ab);
        const double determinant = face.ab.dot(h), sign = determinant < 0 ? -1 : 1;
        const double longest = std::sqrt(std::max(face.ab_ab, face.ac_ac));
        const double slack = kRounding * longest * (d.norm() + longest);
        const double u = sign * d.dot(h), v = sign * direction.dot(q);
        const double w = sign * determinant - u - v;
        const double t = sign * face.ac.dot(q), t_slack = slack * longest;
        if (u < -slack || v < -slack || w < -slack || t < -t_slack) return true;
        if (u <= slack || v <= slack || w <= slack || t <= t_slack) return is_certain = false;
        crossings += determinant < 0 ? 1 : -1;
        return true;
      });
  if (!is_certain) return std::nullopt;
  return crossings;
}

// The winding number of a surface and its lid is the number of crossings. That of the lid is found
// from its solid angles, and subtracted.
std::optional<TriangleBvh::WholeSides> TriangleBvh::CountCrossings(const Vector3d& point_mm,
                                                                   const Vector3d& step_mm,
                                                                   const TriangleBvh* lid) const {
  // Off the normal, because a normal meets the opposite edges of a regular tube.
  const Vector3d direction = (step_mm.normalized() + Vector3d(0.137, -0.093, 0.071)).normalized();
  long numbers[2] = {0, 0};
  for (const int side : {0, 1}) {
    const double sign = side == 0 ? 1 : -1;
    const Vector3d from = point_mm + sign * step_mm, along = sign * direction;
    const std::optional<long> crossings = CrossingsOf(from, along);
    if (!crossings) return std::nullopt;
    numbers[side] = *crossings;
    if (lid == nullptr) continue;
    const std::optional<long> of_lid = lid->CrossingsOf(from, along);
    if (!of_lid) return std::nullopt;
    const double own = lid->WindingNumber(from);
    if (Fraction(own) > kMostFractional) return std::nullopt;
    numbers[side] += *of_lid - std::lround(own);
  }
  return WholeSides{numbers[0], numbers[1]};
}

}  // namespace torquer::vessel
