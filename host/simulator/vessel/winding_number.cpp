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
constexpr double kNoEnd = std::numeric_limits<double>::infinity();

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

// Winding number at the beginning of a ray less that at its end. It is the number of crossings out
// of the surface less that of crossings into it.
std::optional<long> TriangleBvh::CrossingsOf(const Vector3d& from_mm, const Vector3d& direction,
                                             double length_mm) const {
  long crossings = 0;
  bool is_certain = true;
  WalkBoxesOnRay(from_mm, direction, 0, length_mm, [&](int32_t triangle) {
    // Moeller & Trumbore (1997), times the determinant.
    const Face& face = faces_[triangle];
    const Vector3d d = from_mm - face.a, h = direction.cross(face.ac), q = d.cross(face.ab);
    const double determinant = face.ab.dot(h), sign = determinant < 0 ? -1 : 1;
    const double longest = std::sqrt(std::max(face.ab_ab, face.ac_ac));
    const double slack = kRounding * longest * (d.norm() + longest);
    const double u = sign * d.dot(h), v = sign * direction.dot(q);
    const double w = sign * determinant - u - v;
    const double t = sign * face.ac.dot(q), t_slack = slack * longest;
    const double left = length_mm < kNoEnd ? sign * determinant * length_mm - t : kNoEnd;
    if (u < -slack || v < -slack || w < -slack || t < -t_slack || left < -t_slack) return true;
    if (u <= slack || v <= slack || w <= slack || t <= t_slack || left <= t_slack) {
      return is_certain = false;
    }
    crossings += determinant < 0 ? 1 : -1;
    return true;
  });
  if (!is_certain) return std::nullopt;
  return crossings;
}

// The winding number of a surface and its lid is the number of crossings. That of the lid is found
// from its solid angles, and subtracted. A ray gives the outer number. The faces on the short way
// through the face give the difference of both numbers.
std::optional<TriangleBvh::WholeSides> TriangleBvh::CountCrossings(const Vector3d& point_mm,
                                                                   const Vector3d& step_mm,
                                                                   const TriangleBvh* lid) const {
  const Vector3d outward = step_mm.normalized();
  // Off the normal, because a normal meets the opposite edges of a regular tube.
  const Vector3d direction = (outward + Vector3d(0.137, -0.093, 0.071)).normalized();
  const Vector3d outer = point_mm + step_mm, inner = point_mm - step_mm;
  const double through_mm = (outer - inner).norm();
  WholeSides sides{0, 0};
  for (const TriangleBvh* mesh : {this, lid}) {
    if (mesh == nullptr) continue;
    const std::optional<long> out = mesh->CrossingsOf(outer, direction, kNoEnd);
    if (!out) return std::nullopt;
    const std::optional<long> through = mesh->CrossingsOf(outer, -outward, through_mm);
    if (!through) return std::nullopt;
    sides.outer += *out;
    sides.inner += *out - *through;
  }
  if (lid == nullptr) return sides;
  const double own_outer = lid->WindingNumber(outer), own_inner = lid->WindingNumber(inner);
  if (Fraction(own_outer) > kMostFractional || Fraction(own_inner) > kMostFractional) {
    return std::nullopt;
  }
  return WholeSides{sides.outer - std::lround(own_outer), sides.inner - std::lround(own_inner)};
}

}  // namespace torquer::vessel
