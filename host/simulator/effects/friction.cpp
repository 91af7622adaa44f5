#include "host/simulator/effects/friction.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "host/simulator/effects/region_keys.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Friction::Friction(double coefficient, double slip_mm, const EffectContext& context,
                   const FrictionCoating& coating, std::vector<Part> parts)
    : coefficient_(coefficient),
      slip_mm_(slip_mm),
      coating_(coating),
      coated_points_(static_cast<int>(std::lround(coating.length_mm / context.wire.segment_mm() *
                                                  context.wall.points_per_segment))),
      parts_(std::move(parts)),
      moving_(context.moving),
      anchors_(static_cast<std::size_t>(context.wire.max_segments() + 1) *
               static_cast<std::size_t>(context.wall.points_per_segment)),
      lies_(context.wire.twists() ? anchors_.size() : 0) {}

double Friction::CoefficientAt(int from_tip, const Vector3d& point_mm) const {
  const double own = from_tip < coated_points_ ? coating_.coefficient : coefficient_;
  if (parts_.empty()) return own;
  const Vector3d at = moving_ == nullptr ? point_mm : moving_->AtRest(point_mm);
  double factor = 1;
  for (const Part& part : parts_) factor += part.region.Weight(at) * (part.factor - factor);
  return own * factor;
}

void Friction::Place(const Vector3d& at, Anchor& anchor) const {
  anchor.at = at;
  if (moving_ != nullptr) anchor.at_rest = moving_->AtRest(at);
}

void Friction::Reset() {
  for (Anchor& anchor : anchors_) anchor = Anchor();
}

void Friction::Begin(const PointSet& points) {
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    Anchor& anchor = anchors_[points.FromTip(q)];
    anchor.limit_N = 0;
    if (!anchor.holds) continue;
    if (moving_ != nullptr) anchor.at = moving_->Moved(anchor.at_rest, anchor.at);
    if (!points.touches[p]) continue;
    const ClearanceSample& sample = points.clearance[p];
    const double slope = sample.gradient.norm();
    if (!(slope > 1e-6)) continue;
    anchor.normal = sample.gradient / slope;
    if (!lies_.empty()) lies_[points.FromTip(q)] = {points.Tangent(q), points.Normal(q)};
    anchor.limit_N = CoefficientAt(points.FromTip(q), points.position[p]) *
                     points.stiffness_N_mm2[p] * points.weight_mm[p] *
                     (points.radius_mm[p] - sample.clearance_mm) * slope;
  }
}

Friction::Roll Friction::RollAt(const PointSet& points, int q, const Vector3d& normal) const {
  const Lie& lie = lies_[static_cast<std::size_t>(points.FromTip(q))];
  const Vector3d tangent = points.Tangent(q);
  const Vector3d from = ParallelTransport(lie.normal, lie.tangent, tangent);
  const Vector3d& to = points.Normal(q);
  return {.angle_rad = std::atan2(from.cross(to).dot(tangent), from.dot(to)),
          // The surface touches a radius away from the center, against the wall's normal.
          .per_rad_mm = -points.radius_mm[static_cast<std::size_t>(q)] * tangent.cross(normal),
          .area = lie.tangent.cross(tangent) / (1 + lie.tangent.dot(tangent))};
}

double Friction::Add(const PointSet& points, PointDerivatives& out) const {
  double energy = 0;
  for (int q = 0; q < points.size(); ++q) {
    const Anchor& anchor = anchors_[points.FromTip(q)];
    if (anchor.limit_N == 0) continue;
    const auto p = static_cast<std::size_t>(q);
    Vector3d s = points.position[p] - anchor.at;
    s -= s.dot(anchor.normal) * anchor.normal;
    Roll roll;
    if (!lies_.empty()) {
      roll = RollAt(points, q, anchor.normal);
      s += roll.angle_rad * roll.per_rad_mm;
    }
    const double squared = s.squaredNorm();
    const double x2 = squared / (slip_mm_ * slip_mm_);
    const Matrix3d across = Matrix3d::Identity() - anchor.normal * anchor.normal.transpose();
    Vector3d gradient;
    Matrix3d hessian;
    if (x2 < 1) {
      const double stiffness = 1.5 * anchor.limit_N / slip_mm_;
      energy += stiffness * squared * (0.5 - x2 / 12);
      gradient = (stiffness * (1 - x2 / 3)) * s;
      if (out.with_hessian) {
        hessian = (stiffness * (1 - x2 / 3)) * across -
                  (stiffness * 2 / (3 * slip_mm_ * slip_mm_)) * s * s.transpose();
      }
    } else {
      const double distance = std::sqrt(squared);
      energy += anchor.limit_N * (distance - 0.375 * slip_mm_);
      gradient = (anchor.limit_N / distance) * s;
      if (out.with_hessian) {
        hessian = (anchor.limit_N / distance) * (across - s * s.transpose() / squared);
      }
    }
    out.Touch(q);
    out.gradient[p] += gradient;
    if (out.with_hessian) out.hessian[p] += hessian;
    if (lies_.empty()) continue;
    SpinLoad spin{q, gradient.dot(roll.per_rad_mm), 0, Vector3d::Zero()};
    if (out.with_hessian) {
      spin.with_position = hessian * roll.per_rad_mm;
      spin.hessian = roll.per_rad_mm.dot(spin.with_position);
    }
    out.on_spins.push_back(spin);
    out.on_tangents.push_back({q / points.per_segment,
                               spin.gradient * roll.area - (points.radius_mm[p] * roll.angle_rad) *
                                                               anchor.normal.cross(gradient),
                               Matrix3d::Zero()});
  }
  return energy;
}

void Friction::SlideSurface(const PointSet& points, int last, double by_mm) {
  for (int q = 0; q <= last; ++q) {
    Anchor& anchor = anchors_[points.FromTip(q)];
    if (anchor.holds) Place(anchor.at - by_mm * points.Tangent(q), anchor);
  }
}

void Friction::End(const PointSet& points) {
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    Anchor& anchor = anchors_[points.FromTip(q)];
    if (!points.touches[p]) {
      anchor.holds = false;
      continue;
    }
    if (!anchor.holds) {
      anchor.holds = true;
      Place(points.position[p], anchor);
      continue;
    }
    Vector3d s = points.position[p] - anchor.at;
    const Vector3d& gradient = points.clearance[p].gradient;
    bool rolled = false;
    if (anchor.limit_N > 0 && !lies_.empty()) {
      // From now on it is a displacement like any other.
      const Roll roll = RollAt(points, q, anchor.normal);
      s += roll.angle_rad * roll.per_rad_mm;
      rolled = true;
    }
    const Vector3d whole = s;
    s -= (s.dot(gradient) / std::max(gradient.squaredNorm(), 1e-12)) * gradient;
    const double distance = s.norm();
    if (distance > slip_mm_) {
      Place(points.position[p] - (slip_mm_ / distance) * s, anchor);
    } else if (rolled) {
      Place(points.position[p] - whole, anchor);
    }
  }
  // What left through the sheath will touch somewhere else when it comes back.
  for (int k = points.size(); k < anchored_; ++k) anchors_[static_cast<std::size_t>(k)] = Anchor();
  anchored_ = points.size();
}

std::uint64_t Friction::Hash(std::uint64_t seed) const {
  for (const Anchor& anchor : anchors_) {
    if (!anchor.holds) continue;
    for (const double value : {anchor.at[0], anchor.at[1], anchor.at[2]}) {
      std::uint64_t bits = 0;
      std::memcpy(&bits, &value, sizeof bits);
      seed = (seed ^ bits) * 0x100000001b3ULL;
    }
  }
  return seed;
}

EffectKind FrictionKind() {
  static const Key kCoefficient = {"coefficient", "", 0, 2, std::nullopt, "of Coulomb's law, mu"};
  static const Key kSlip = {
      "slip_mm", "mm", 1e-5, 0.1, 0.005, "displacement at which a sticking contact begins to slip"};
  static const Key kCoating = {
      "coating_mm", "mm", 0, 5000, 0, "length of the wire's end with a coating of its own"};
  static const Key kCoated = {"coating_coefficient", "", 0, 2, 0.0, "of the coated end"};
  return {
      .name = "friction",
      .summary = "Coulomb friction of the wire on the wall, with stick and slip",
      .roles = "energy term",
      .keys = {kCoefficient, kSlip, kCoating, kCoated},
      .other_keys =
          RegionKeys({{"region.factor", "0 to 20", "times the wire's coefficient, on that wall"}}),
      .needs = "",
      .make = [](StrictTable& keys, const EffectContext& context) -> std::unique_ptr<Effect> {
        const double coefficient = kCoefficient.Read(keys);
        const double slip_mm = kSlip.Read(keys);
        FrictionCoating coating;
        coating.length_mm = kCoating.Read(keys);
        if (keys.Has("coating_coefficient") != (coating.length_mm > 0)) {
          keys.Refuse("coating_mm", "and coating_coefficient need each other; give both");
        }
        coating.coefficient = kCoated.Read(keys);
        std::vector<Friction::Part> parts;
        for (StrictTable* region : keys.Tables("region")) {
          const double factor = region->Number("factor", 0, 20);
          parts.push_back({ReadRegion(*region, context), factor});
        }
        return std::make_unique<Friction>(coefficient, slip_mm, context, coating, std::move(parts));
      }};
}

}  // namespace torquer::effects
