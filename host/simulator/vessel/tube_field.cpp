#include "host/simulator/vessel/tube_field.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "host/simulator/vessel/tube_sphere.h"
#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double kNoTube = -std::numeric_limits<double>::infinity();  // value without a tube

// Slopes of a monotone cubic through (x, y) (Fritsch & Butland 1984): 0 at the ends and at extrema.
std::vector<double> MonotoneSlopes(const std::vector<double>& x, const std::vector<double>& y) {
  std::vector<double> slopes(x.size(), 0.0);
  for (size_t i = 1; i + 1 < x.size(); ++i) {
    const double left = (y[i] - y[i - 1]) / (x[i] - x[i - 1]);
    const double right = (y[i + 1] - y[i]) / (x[i + 1] - x[i]);
    if (left * right > 0) slopes[i] = 2 * left * right / (left + right);
  }
  return slopes;
}

[[noreturn]] void Refuse(const Tube& tube, const std::string& what) {
  throw UserError("tube \"" + tube.name + "\": " + what);
}

void Check(const Tube& tube) {
  if (tube.axis.pieces().empty()) Refuse(tube, "the axis is empty; give it a length");
  if (tube.radii_mm.empty() ||
      (tube.radii_mm.size() > 1 && tube.radii_mm.size() != tube.radius_at_mm.size())) {
    Refuse(tube, std::to_string(tube.radii_mm.size()) +
                     " radii; give one, or one for each of the " +
                     std::to_string(tube.radius_at_mm.size()) + " stations");
  }
  const double bend_radius_mm = tube.axis.SmallestBendRadius();
  for (double radius : tube.radii_mm) {
    if (!(radius > 0) || !std::isfinite(radius)) {
      Refuse(tube, "radius " + std::to_string(radius) + " mm; give a radius above 0");
    }
    if (radius > 0.95 * bend_radius_mm) {
      Refuse(tube, "radius " + std::to_string(radius) + " mm at a bend radius of " +
                       std::to_string(bend_radius_mm) +
                       " mm folds the wall over; give the bend a larger radius, or the tube a "
                       "radius of at most 95 % of the bend radius");
    }
  }
  for (size_t i = 1; i < tube.radii_mm.size(); ++i) {
    const double span = tube.radius_at_mm[i] - tube.radius_at_mm[i - 1];
    // A monotone cubic is at most twice as steep as its chord.
    if (!(span > 0) || 2 * std::abs(tube.radii_mm[i] - tube.radii_mm[i - 1]) > 0.5 * span) {
      Refuse(tube, "the radius goes from " + std::to_string(tube.radii_mm[i - 1]) + " to " +
                       std::to_string(tube.radii_mm[i]) + " mm within " + std::to_string(span) +
                       " mm of axis; the change must be at most a quarter of that length");
    }
  }
}

}  // namespace

TubeField::Primitive TubeField::MakePrimitive(const PathPiece& piece, double from, double to,
                                              const Tube& tube, const std::vector<double>& slopes) {
  Primitive primitive;
  const double u0 = from - piece.begin_mm;
  primitive.length = to - from;
  primitive.is_arc = piece.curvature_per_mm > 0;
  if (primitive.is_arc) {
    const double radius = 1 / piece.curvature_per_mm;
    const double middle = u0 + primitive.length / 2;
    primitive.origin = piece.start_mm + radius * piece.normal;
    primitive.x = (piece.PointAt(middle) - primitive.origin).normalized();
    primitive.y = piece.TangentAt(middle).normalized();
    primitive.bend_radius = radius;
    primitive.half_angle = primitive.length / (2 * radius);
    primitive.cos_half = std::cos(primitive.half_angle);
    primitive.sin_half = std::sin(primitive.half_angle);
    // A full circle has no ends: rounding must not make one.
    if (primitive.half_angle > M_PI * (1 - 1e-12)) primitive.cos_half = -2;
  } else {
    primitive.origin = piece.PointAt(u0);
    primitive.x = piece.tangent;
    primitive.y = AnyOrthogonal(piece.tangent);
  }
  primitive.z = primitive.x.cross(primitive.y);
  // Cubic of the radius, from the knots on either side.
  const auto& at = tube.radius_at_mm;
  const double middle = (from + to) / 2;
  const size_t after = std::upper_bound(at.begin(), at.end(), middle) - at.begin();
  double largest = 0;
  if (tube.radii_mm.size() == 1 || after == 0 || after == at.size()) {
    primitive.r0 =
        tube.radii_mm.size() == 1 || after == 0 ? tube.radii_mm.front() : tube.radii_mm.back();
    largest = primitive.r0;
  } else {
    const double span = at[after] - at[after - 1];
    const double rise = tube.radii_mm[after] - tube.radii_mm[after - 1];
    const double m0 = slopes[after - 1], m1 = slopes[after];
    const double a1 = m0, a2 = (3 * rise / span - 2 * m0 - m1) / span;
    const double a3 = (m0 + m1 - 2 * rise / span) / (span * span);
    const double b = from - at[after - 1];
    primitive.r0 = tube.radii_mm[after - 1] + b * (a1 + b * (a2 + b * a3));
    primitive.r1 = a1 + b * (2 * a2 + b * 3 * a3);
    primitive.r2 = a2 + 3 * a3 * b;
    primitive.r3 = a3;
    primitive.constant_radius = rise == 0;
    largest = std::max(tube.radii_mm[after - 1], tube.radii_mm[after]);
  }
  primitive.ball_center = piece.PointAt(u0 + primitive.length / 2);
  const double reach = std::max((piece.PointAt(u0) - primitive.ball_center).norm(),
                                primitive.half_angle > M_PI / 2 ? 2 * primitive.bend_radius : 0);
  primitive.ball_radius = (reach + largest) * (1 + 1e-12);
  return primitive;
}

TubeField::TubeField(const std::vector<Tube>& tubes, double union_width_mm)
    : union_width_mm_(union_width_mm),
      smallest_radius_mm_(std::numeric_limits<double>::infinity()) {
  if (tubes.empty()) throw UserError("the vessel has no tubes; give at least one");
  if (!(union_width_mm >= 0)) {
    throw UserError("union width " + std::to_string(union_width_mm) + " mm; give 0 or more");
  }
  for (const Tube& tube : tubes) {
    Check(tube);
    TubeData data;
    const double smallest = *std::min_element(tube.radii_mm.begin(), tube.radii_mm.end());
    smallest_radius_mm_ = std::min(smallest_radius_mm_, smallest);
    data.round_mm = smallest / 2;
    std::vector<double> slopes;
    if (tube.radii_mm.size() > 1) slopes = MonotoneSlopes(tube.radius_at_mm, tube.radii_mm);
    const double largest = *std::max_element(tube.radii_mm.begin(), tube.radii_mm.end());
    auto knot = tube.radius_at_mm.begin();
    Eigen::AlignedBox3d box;
    for (const PathPiece& piece : tube.axis.pieces()) {
      const double end = piece.begin_mm + piece.length_mm;
      std::vector<double> cuts{piece.begin_mm};
      // Knots and pieces are both in ascending order.
      for (; tube.radii_mm.size() > 1 && knot != tube.radius_at_mm.end(); ++knot) {
        if (*knot >= end - 1e-9) break;
        if (*knot > cuts.back() + 1e-9) cuts.push_back(*knot);
      }
      cuts.push_back(end);
      for (size_t i = 1; i < cuts.size(); ++i) {
        data.primitives.push_back(MakePrimitive(piece, cuts[i - 1], cuts[i], tube, slopes));
        const Primitive& made = data.primitives.back();
        box.extend(made.ball_center);
      }
      // Samples bound the lumen more tightly than the balls; the sagitta between them is added.
      for (int i = 0; i <= 64; ++i) {
        const Vector3d at = piece.PointAt(piece.length_mm * i / 64);
        const double turn = piece.curvature_per_mm * piece.length_mm / 128;
        const double margin = largest + (turn > 0 ? turn * turn / 2 / piece.curvature_per_mm : 0);
        bounds_mm_.extend(at + Vector3d::Constant(margin));
        bounds_mm_.extend(at - Vector3d::Constant(margin));
      }
    }
    data.ball_center = box.center();
    for (const Primitive& primitive : data.primitives) {
      data.ball_radius =
          std::max(data.ball_radius,
                   (primitive.ball_center - data.ball_center).norm() + primitive.ball_radius);
    }
    tubes_.push_back(std::move(data));
  }
  bounds_mm_.extend(bounds_mm_.max() + Vector3d::Constant(union_width_mm / 6));
  bounds_mm_.extend(bounds_mm_.min() - Vector3d::Constant(union_width_mm / 6));
}

namespace {

// Offset of a point from the axis at u: v = p - axis(u). `along`: v's component along the tangent
// t. `curved`: v . axis''(u).
struct AxisOffset {
  Vector3d v, t;
  double along, curved;
};

template <typename Primitive>
AxisOffset OffsetAt(const Primitive& primitive, const Vector3d& p, double u) {
  AxisOffset offset;
  const Vector3d d = p - primitive.origin;
  if (primitive.is_arc) {
    const double angle = u / primitive.bend_radius - primitive.half_angle;
    const double c = std::cos(angle), s = std::sin(angle);
    const Vector3d out = c * primitive.x + s * primitive.y;
    offset.v = d - primitive.bend_radius * out;
    offset.t = c * primitive.y - s * primitive.x;
    offset.along = offset.v.dot(offset.t);
    offset.curved = -offset.v.dot(out) / primitive.bend_radius;
  } else {
    offset.v = d - u * primitive.x;
    offset.t = primitive.x;
    offset.along = offset.v.dot(offset.t);
    offset.curved = 0;
  }
  return offset;
}

}  // namespace

void TubeField::Look(const Primitive& primitive, double round_mm, const Vector3d& p,
                     Contact& best) {
  const double reach = primitive.ball_radius - best.value;
  if (reach <= 0 || (p - primitive.ball_center).squaredNorm() > reach * reach) {
    return;
  }
  const Vector3d d = p - primitive.origin;
  const double along = d.dot(primitive.x);
  double u = 0;
  bool interior = true;
  if (!primitive.is_arc && primitive.constant_radius) {
    u = std::clamp(along, 0.0, primitive.length);
    const double value =
        primitive.r0 - Rounded((d - u * primitive.x).squaredNorm(), round_mm).value;
    if (value > best.value) best = {value, u, &primitive, u == along};
    return;
  }
  const double across = d.dot(primitive.y), height = d.dot(primitive.z);
  const Vector3d own(along, across, height);
  SphereOffset foot = {};
  if (!primitive.is_arc) {
    u = std::clamp(along, 0.0, primitive.length);
    foot = SphereAt(primitive, own, u);
  } else {
    const double in_plane = std::sqrt(along * along + across * across);
    if (along >= primitive.cos_half * in_plane) {
      const double off = in_plane - primitive.bend_radius;
      foot = {height * height + off * off, 0, -off / primitive.bend_radius};
      // Only a changing radius needs u here; for a constant one, Differentiate finds it.
      u = primitive.constant_radius
              ? 0
              : (std::atan2(across, along) + primitive.half_angle) * primitive.bend_radius;
    } else {
      interior = false;
      u = across < 0 ? 0 : primitive.length;
      const double ex = along - primitive.bend_radius * primitive.cos_half;
      const double ey = std::abs(across) - primitive.bend_radius * primitive.sin_half;
      foot.distance2 = height * height + ex * ex + ey * ey;
      if (!primitive.constant_radius) foot = SphereAt(primitive, own, u);
    }
  }
  const double value = primitive.constant_radius
                           ? primitive.r0 - Rounded(foot.distance2, round_mm).value
                           : Climb(primitive, own, round_mm, foot, u, interior);
  if (value > best.value) best = {value, u, &primitive, interior};
}

// F(p, u) = r(u) - Q(|p - axis(u)|^2) is stationary in u if the contact is interior. Then the
// gradient is F_p, and the Hessian F_pp - F_pu F_pu^T / F_uu (implicit function theorem).
template <int kOrder>
void TubeField::Differentiate(const Contact& contact, double round_mm, const Vector3d& p,
                              Vector3d& gradient, Matrix3d& hessian) {
  const Primitive& primitive = *contact.primitive;
  double u = contact.u;
  AxisOffset offset;
  if (primitive.is_arc && contact.interior && primitive.constant_radius) {
    const Vector3d d = p - primitive.origin;
    const double along = d.dot(primitive.x), across = d.dot(primitive.y);
    const double in_plane = std::sqrt(along * along + across * across);
    const double c = in_plane > 0 ? along / in_plane : 1, s = in_plane > 0 ? across / in_plane : 0;
    const Vector3d out = c * primitive.x + s * primitive.y;
    offset.v = d - primitive.bend_radius * out;
    offset.t = c * primitive.y - s * primitive.x;
    offset.along = 0;
    offset.curved = 1 - in_plane / primitive.bend_radius;
  } else {
    offset = OffsetAt(primitive, p, u);
  }
  const RoundedDistance q = Rounded(offset.v.squaredNorm(), round_mm);
  gradient = -2 * q.first * offset.v;
  if constexpr (kOrder >= 2) {
    hessian.noalias() = (-4 * q.second * offset.v) * offset.v.transpose();
    hessian.diagonal().array() -= 2 * q.first;
    if (contact.interior) {
      const Vector3d mixed = 2 * q.first * offset.t + 4 * q.second * offset.along * offset.v;
      const double bend = 2 * primitive.r2 + 6 * u * primitive.r3 +
                          2 * q.first * (offset.curved - 1) -
                          4 * q.second * offset.along * offset.along;
      // On the axis of a bend, far outside the lumen, all spheres are equally near: bounded there.
      hessian -= mixed * mixed.transpose() / std::min(bend, -0.02 * 2 * q.first);
    }
  }
}

template <int kOrder>
double TubeField::Evaluate(const Vector3d& p, ClearanceSample* out) const {
  double value = 0;
  bool first = true;
  Vector3d gradient;
  Matrix3d hessian;
  for (const TubeData& tube : tubes_) {
    // A later tube has no effect if all its spheres stay below the blend.
    const double least = first ? kNoTube : value - union_width_mm_;
    const double reach = tube.ball_radius - least;
    if (reach <= 0 || (p - tube.ball_center).squaredNorm() > reach * reach) continue;
    Contact contact{least, 0, first ? &tube.primitives.front() : nullptr, false};
    for (const Primitive& primitive : tube.primitives) Look(primitive, tube.round_mm, p, contact);
    if (contact.primitive == nullptr) continue;
    if (first) {
      value = contact.value;
      if constexpr (kOrder >= 1) {
        Differentiate<kOrder>(contact, tube.round_mm, p, gradient, hessian);
      }
      first = false;
      continue;
    }
    const double difference = value - contact.value;
    const double h = union_width_mm_ - std::abs(difference);
    value = Blend(value, contact.value);
    if (h <= 0) {
      if (difference >= 0) continue;
      if constexpr (kOrder >= 1) {
        Differentiate<kOrder>(contact, tube.round_mm, p, gradient, hessian);
      }
      continue;
    }
    if constexpr (kOrder >= 1) {
      // The first derivatives of Blend are the weights of the two, its second is h / w^2.
      const double w2 = union_width_mm_ * union_width_mm_;
      Vector3d other;
      Matrix3d other_hessian;
      Differentiate<kOrder>(contact, tube.round_mm, p, other, other_hessian);
      const double lesser = h * h / (2 * w2);
      const double weight = difference >= 0 ? 1 - lesser : lesser;
      const Vector3d change = gradient - other;
      if constexpr (kOrder >= 2) {
        hessian = weight * hessian + (1 - weight) * other_hessian +
                  (h / w2) * (change * change.transpose());
      }
      gradient = other + weight * change;
    }
  }
  if constexpr (kOrder >= 1) {
    out->clearance_mm = value;
    out->gradient = gradient;
    if constexpr (kOrder >= 2) out->hessian = hessian;
  }
  return value;
}

// Smooth maximum of the values of two tubes: max + h^3 / (6 w^2) within the union width w.
double TubeField::Blend(double value, double other) const {
  const double h = union_width_mm_ - std::abs(value - other);
  if (h <= 0) return std::max(value, other);
  return std::max(value, other) + h * h * h / (6 * union_width_mm_ * union_width_mm_);
}

double TubeField::Clearance(const Vector3d& point_mm) const {
  return Evaluate<0>(point_mm, nullptr);
}

void TubeField::EvaluateGradient(const Vector3d& point_mm, ClearanceSample& out) const {
  Evaluate<1>(point_mm, &out);
}

void TubeField::EvaluateHessian(const Vector3d& point_mm, ClearanceSample& out) const {
  Evaluate<2>(point_mm, &out);
}

Centerline CenterlineOf(const Tube& tube, double step_mm) {
  const int steps = std::max(1, static_cast<int>(std::ceil(tube.axis.length_mm() / step_mm)));
  std::vector<Vector3d> points, tangents;
  std::vector<double> radii;
  std::vector<double> slopes;
  if (tube.radii_mm.size() > 1) slopes = MonotoneSlopes(tube.radius_at_mm, tube.radii_mm);
  for (int i = 0; i <= steps; ++i) {
    const double s = tube.axis.length_mm() * i / steps;
    points.push_back(tube.axis.PointAt(s));
    tangents.push_back(tube.axis.TangentAt(s));
    const auto& at = tube.radius_at_mm;
    const size_t after = std::upper_bound(at.begin(), at.end(), s) - at.begin();
    if (tube.radii_mm.size() == 1 || after == 0) {
      radii.push_back(tube.radii_mm.front());
    } else if (after == at.size()) {
      radii.push_back(tube.radii_mm.back());
    } else {
      const double span = at[after] - at[after - 1], x = (s - at[after - 1]) / span;
      radii.push_back(tube.radii_mm[after - 1] * (1 + 2 * x) * (1 - x) * (1 - x) +
                      tube.radii_mm[after] * x * x * (3 - 2 * x) +
                      span * x * (1 - x) * (slopes[after - 1] * (1 - x) - slopes[after] * x));
    }
  }
  return Centerline(tube.name, points, tangents, radii);
}

}  // namespace torquer::vessel
