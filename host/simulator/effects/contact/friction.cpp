#include "host/simulator/effects/contact/friction.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/core/hash.h"
#include "host/simulator/effects/contact/stick_slip.h"
#include "host/simulator/effects/region_spec.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

Friction::Friction(double coefficient, double slip_mm, const EffectContext& context,
                   std::vector<Part> parts)
    : slip_mm_(slip_mm),
      parts_(std::move(parts)),
      moving_(context.moving),
      anchors_(static_cast<std::size_t>(context.wire.max_segments() + 1) *
               static_cast<std::size_t>(context.wall.points_per_segment)),
      lies_(context.wire.spins() > 0 ? anchors_.size() : 0) {
  for (const Instrument& instrument : context.instruments) {
    surfaces_.push_back({instrument.friction_coefficient.value_or(coefficient),
                         instrument.coating_mm, instrument.coating_coefficient});
  }
  if (surfaces_.empty()) surfaces_.push_back({coefficient, 0, 0});
}

namespace {

// How the surface that touches moves where the wire turns about its tangent, mm per rad. It touches
// a radius away from the center, against the wall's normal.
Vector3d SurfacePerRad(const PointSet& points, int q, const Vector3d& normal) {
  return -points.radius_mm[static_cast<std::size_t>(q)] * points.Tangent(q).cross(normal);
}

}  // namespace

double Friction::CoefficientAt(const PointSet& points, int q) const {
  constexpr double kRoundingMm = 1e-9;
  const int instrument = points.SurfaceAt(q);
  const Surface& surface = surfaces_[static_cast<std::size_t>(instrument)];
  const bool coated = points.FromTipOf(instrument, q) < surface.coating_mm - kRoundingMm;
  const double own = coated ? surface.coating_coefficient : surface.coefficient;
  if (parts_.empty()) return own;
  const Vector3d& point_mm = points.position[static_cast<std::size_t>(q)];
  const Vector3d at = moving_ == nullptr ? point_mm : moving_->AtRest(point_mm);
  double factor = 1;
  for (const Part& part : parts_) factor += part.region.Weight(at) * (part.factor - factor);
  return own * factor;
}

void Friction::Place(const Vector3d& at, Anchor& anchor) const {
  anchor.at = at;
  if (moving_ != nullptr) anchor.at_rest = moving_->AtRest(at);
}

void Friction::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Friction&>(twin);
  anchors_ = from.anchors_;
  lies_ = from.lies_;
  anchored_ = from.anchored_;
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
    if (!lies_.empty()) lies_[points.FromTip(q)] = LieOf(points, q);
    anchor.limit_N = CoefficientAt(points, q) * points.stiffness_N_mm2[p] * points.weight_mm[p] *
                     (points.radius_mm[p] - sample.clearance_mm) * slope;
  }
}

Friction::Lie Friction::LieOf(const PointSet& points, int q) {
  return {points.Tangent(q), points.Normal(q), points.SurfaceAt(q)};
}

Friction::Roll Friction::RollAt(const PointSet& points, int q, const Vector3d& normal) const {
  const Lie& lie = lies_[static_cast<std::size_t>(points.FromTip(q))];
  if (lie.instrument != points.SurfaceAt(q)) return {};  // another's surface has come there
  const Vector3d tangent = points.Tangent(q);
  const Vector3d from = ParallelTransport(lie.normal, lie.tangent, tangent);
  const Vector3d to = points.Normal(q);
  return {.angle_rad = std::atan2(from.cross(to).dot(tangent), from.dot(to)),
          .per_rad_mm = SurfacePerRad(points, q, normal),
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
    const StickSlip law(anchor.limit_N, slip_mm_, s.squaredNorm());
    energy += law.energy_mJ;
    const Vector3d gradient = law.secant_N_mm * s;
    Matrix3d hessian;
    if (out.with_hessian) {
      hessian =
          law.secant_N_mm * (Matrix3d::Identity() - anchor.normal * anchor.normal.transpose()) -
          law.softening_N_mm3 * s * s.transpose();
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

void Friction::MoveSurfaces(const PointSet& points,
                            const std::array<SurfaceMove, kMostInstruments>& moves) {
  for (int q = 0; q < points.size(); ++q) {
    const auto p = static_cast<std::size_t>(q);
    Anchor& anchor = anchors_[points.FromTip(q)];
    if (!anchor.holds) continue;
    const SurfaceMove& move = moves[static_cast<std::size_t>(points.SurfaceAt(q))];
    if (move.along_mm != 0) Place(anchor.at - move.along_mm * points.Tangent(q), anchor);
    if (move.turn_rad == 0 || !points.touches[p]) continue;
    const Vector3d normal = points.clearance[p].gradient.normalized();
    Place(anchor.at - move.turn_rad * SurfacePerRad(points, q, normal), anchor);
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
      // From now on it is a displacement like any other, and no turn since.
      const Roll roll = RollAt(points, q, anchor.normal);
      s += roll.angle_rad * roll.per_rad_mm;
      lies_[points.FromTip(q)] = LieOf(points, q);
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
    for (const double component : anchor.at) seed = HashDouble(component, seed);
    // What the budget cut short goes on with these.
    if (anchor.limit_N == 0) continue;
    seed = HashDouble(anchor.limit_N, seed);
    for (const double component : anchor.normal) seed = HashDouble(component, seed);
  }
  return seed;
}

namespace {

struct FrictionPartSpec : RegionSpec {
  double factor = 1;
};

struct FrictionSpec : TableSpec {
  double coefficient = 0;
  double slip_mm = 0.005;
  std::vector<FrictionPartSpec> regions;
};

const Keys<FrictionPartSpec>& PartKeys() {
  static const Keys<FrictionPartSpec> keys = Keys<FrictionPartSpec>()
                                                 .Include(RegionKeys())
                                                 .Required()
                                                 .Number("factor", &FrictionPartSpec::factor, 0, 20,
                                                         "", "times the coefficient, on that wall");
  return keys;
}

const Keys<FrictionSpec>& FrictionKeys() {
  static const Keys<FrictionSpec> keys =
      Keys<FrictionSpec>()
          .Required()
          .Number("coefficient", &FrictionSpec::coefficient, 0, 2, "",
                  "of Coulomb's law, mu; an instrument may have another (friction_coefficient)")
          .Number("slip_mm", &FrictionSpec::slip_mm, 1e-5, 0.1, "mm",
                  "displacement at which a sticking contact begins to slip")
          .Tables("region", &FrictionSpec::regions, PartKeys(), 0,
                  "parts of the vessel with another friction; later ones lie over earlier ones")
          .Example("coefficient = 0.08\n");
  return keys;
}

std::unique_ptr<Effect> Make(const FrictionSpec& spec, const EffectContext& context) {
  std::vector<Friction::Part> parts;
  for (const FrictionPartSpec& part : spec.regions) {
    parts.push_back({MakeRegion(part, context), part.factor});
  }
  return std::make_unique<Friction>(spec.coefficient, spec.slip_mm, context, std::move(parts));
}

}  // namespace

EffectKind FrictionKind() {
  return {.name = "friction",
          .summary = "Coulomb friction of the instruments on the wall, with stick and slip",
          .roles = "energy term",
          .keys = Any(FrictionKeys()),
          .make = MakeWith(Make)};
}

}  // namespace torquer::effects
