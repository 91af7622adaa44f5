#include "host/simulator/effects/contact/friction.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/core/hash.h"
#include "host/simulator/effects/contact/stick_slip.h"
#include "host/simulator/effects/region_spec.h"

namespace torquer::effects {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Coefficient of an instrument's surface by the distance from its tip. A coating ends just before a
// point at its length.
ValuesAlong CoefficientAlong(const Instrument& instrument, double otherwise) {
  constexpr double kRoundingMm = 1e-9;
  ValuesAlong own = instrument.friction_coefficient.value_or(ValuesAlong(otherwise));
  if (instrument.coating_mm <= 2 * kRoundingMm) return own;
  const double coated = instrument.coating_coefficient;
  return {{0, instrument.coating_mm - 2 * kRoundingMm, instrument.coating_mm - kRoundingMm},
          {coated, coated, own.At(instrument.coating_mm)}};
}

}  // namespace

Friction::Friction(double coefficient, double slip_mm, const EffectContext& context,
                   std::vector<RegionFactor> regions)
    : slip_mm_(slip_mm),
      regions_(std::move(regions)),
      moving_(context.moving),
      stride_(static_cast<std::size_t>(context.wire.max_segments() + 1) *
              static_cast<std::size_t>(context.wall.points_per_segment)) {
  for (const Instrument& instrument : context.instruments) {
    coefficients_.push_back(CoefficientAlong(instrument, coefficient));
  }
  if (coefficients_.empty()) coefficients_.emplace_back(coefficient);
  const std::size_t spots = stride_ * coefficients_.size();
  anchors_.resize(spots);
  presses_.resize(spots);
  if (context.wire.spins() > 0) local_frames_.resize(spots);
  on_curves_.resize(context.stack == nullptr ? 1
                                             : static_cast<std::size_t>(context.stack->curves()));
  for (Spots& on : on_curves_) {
    for (std::vector<std::size_t>* some : {&on.pressed, &on.holding, &on.acting}) {
      some->reserve(spots);
    }
  }
}

namespace {

// Displacement of the touching surface per turn of the wire about its tangent, mm per rad. The
// surface touches a radius away from the center, against the wall's normal.
Vector3d SurfacePerRad(const PointSet& points, int q, const Vector3d& normal) {
  return -points.radius_mm[static_cast<std::size_t>(q)] * points.Tangent(q).cross(normal);
}

}  // namespace

double Friction::CoefficientAt(const PointSet& points, int q, int instrument) const {
  const double own =
      coefficients_[static_cast<std::size_t>(instrument)].At(points.FromTipOf(instrument, q));
  if (regions_.empty()) return own;
  const Vector3d& point_mm = points.position[static_cast<std::size_t>(q)];
  const Vector3d at = moving_ == nullptr ? point_mm : moving_->AtRest(point_mm);
  double factor = 1;
  for (const RegionFactor& wall : regions_)
    factor += wall.region.Weight(at) * (wall.factor - factor);
  return own * factor;
}

void Friction::Place(const Vector3d& at, Anchor& anchor) const {
  anchor.at = at;
  if (moving_ != nullptr) anchor.at_rest = moving_->AtRest(at);
}

PointSet::Place Friction::PlaceOf(const PointSet& points, std::size_t spot) const {
  const std::size_t instrument = spot / stride_;
  return points.PlaceAt(static_cast<double>(spot - instrument * stride_) * points.spacing_mm +
                        points.instruments.behind_mm[instrument]);
}

namespace {

// Shares a force at the place `at` between the spots around it, 0 to `last`. All places are in
// spots from the tip. The part of a spot falls with its distance, to 0 at a segment. So the same
// load on every chord gives the same force to every spot. This also holds where chords touch with
// their ends alone. The spots at both ends also take the parts of spots beyond them.
template <class Press>
void Spread(double at, int per_segment, double last, const Press& press) {
  const int nearest = static_cast<int>(at);
  for (int from_tip = nearest - per_segment + 1; from_tip <= nearest + per_segment; ++from_tip) {
    const double part = (1 - std::abs(at - from_tip) / per_segment) / per_segment;
    if (part <= 0) continue;
    press(static_cast<std::size_t>(std::clamp(from_tip, 0, static_cast<int>(last))), part);
  }
}

}  // namespace

// Shares a contact force at a point between an instrument's spots on either side, by the lever
// rule. With several instruments on the curve, Spread shares it.
void Friction::PressSpots(const PointSet& points, int q, int instrument, const Vector3d& normal_N) {
  constexpr double kRounding = 1e-9;
  Spots& on = SpotsOn(points);
  const double spacing_mm = points.spacing_mm;
  const double inserted_mm = points.FromTipMm(0) + points.first_spacing_mm;
  const auto number = static_cast<std::size_t>(instrument);
  const double behind_mm = points.instruments.behind_mm[number];
  const double at = std::max(0.0, (points.FromTipMm(q) - behind_mm) / spacing_mm);
  const double limit_N = CoefficientAt(points, q, instrument) * normal_N.norm();
  const auto press = [&](std::size_t from_tip, double weight) {
    const std::size_t spot = number * stride_ + from_tip;
    Press& here = presses_[spot];
    if (!here.touches) on.pressed.push_back(spot);
    here.touches = true;
    here.normal_N += weight * normal_N;
    here.limit_N += weight * limit_N;
  };
  if (points.instruments.last - points.instruments.first > 1) {
    Spread(at, points.per_segment, (inserted_mm - behind_mm) / spacing_mm - kRounding, press);
    return;
  }
  const auto first = static_cast<std::size_t>(at + kRounding);
  double fraction = std::max(0.0, at - static_cast<double>(first));
  const double next_mm = static_cast<double>(first + 1) * spacing_mm + behind_mm;
  if (fraction < kRounding || next_mm > inserted_mm) fraction = 0;
  press(first, 1 - fraction);
  if (fraction > 0) press(first + 1, fraction);
}

void Friction::FindPresses(const PointSet& points) {
  Spots& on = SpotsOn(points);
  for (const std::size_t spot : on.pressed) presses_[spot] = Press();
  on.pressed.clear();
  for (const int q : points.near) {
    const auto p = static_cast<std::size_t>(q);
    if (!points.touches[p]) continue;
    const ClearanceSample& sample = points.clearance[p];
    const Vector3d per_mm_N = (points.stiffness_N_mm2[p] * points.weight_mm[p]) * sample.gradient;
    const PointSet::Parted* parted = points.PartsOf(q);
    if (parted == nullptr) {
      PressSpots(points, q, points.SurfaceAt(q),
                 (points.radius_mm[p] - sample.clearance_mm) * per_mm_N);
      continue;
    }
    for (int m = 0; m < parted->touching; ++m) {
      const PointSet::Parted::Part& part = parted->parts[static_cast<std::size_t>(m)];
      PressSpots(
          points, q, part.instrument,
          (part.fraction / parted->acts * (part.radius_mm - sample.clearance_mm)) * per_mm_N);
    }
  }
}

void Friction::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const Friction&>(twin);
  anchors_ = from.anchors_;
  local_frames_ = from.local_frames_;
  presses_ = from.presses_;
  on_curves_ = from.on_curves_;
}

void Friction::Reset() {
  for (Spots& on : on_curves_) {
    for (auto* const spots : {&on.holding, &on.acting}) {
      for (const std::size_t spot : *spots) anchors_[spot] = Anchor();
      spots->clear();
    }
  }
}

void Friction::Begin(const PointSet& points) {
  Spots& on = SpotsOn(points);
  for (const std::size_t spot : on.acting) anchors_[spot].limit_N = 0;
  on.acting.clear();
  if (moving_ != nullptr) {
    for (const std::size_t spot : on.holding) {
      Anchor& anchor = anchors_[spot];
      anchor.at = moving_->Moved(anchor.at_rest, anchor.at);
    }
  }
  FindPresses(points);
  for (const std::size_t spot : on.pressed) {
    Anchor& anchor = anchors_[spot];
    const Press& press = presses_[spot];
    const double force_N = press.normal_N.norm();
    const PointSet::Place place = PlaceOf(points, spot);
    if (!anchor.holds || place.point < 0 || !(force_N > 0)) continue;
    anchor.normal = press.normal_N / force_N;
    anchor.limit_N = press.limit_N;
    if (anchor.limit_N > 0) on.acting.push_back(spot);
    if (!local_frames_.empty()) local_frames_[spot] = LocalFrameOf(points, spot, place.point);
  }
}

Friction::LocalFrame Friction::LocalFrameOf(const PointSet& points, std::size_t spot,
                                            int point) const {
  return {points.Tangent(point), points.NormalOf(InstrumentOf(spot), point)};
}

Friction::RollingSlip Friction::RollingSlipAt(const PointSet& points, std::size_t spot, int point,
                                              const Vector3d& normal) const {
  const LocalFrame& local = local_frames_[spot];
  const Vector3d tangent = points.Tangent(point);
  const Vector3d from = ParallelTransport(local.normal, local.tangent, tangent);
  const Vector3d to = points.NormalOf(InstrumentOf(spot), point);
  return {.angle_rad = std::atan2(from.cross(to).dot(tangent), from.dot(to)),
          .per_rad_mm = SurfacePerRad(points, point, normal),
          .area = local.tangent.cross(tangent) / (1 + local.tangent.dot(tangent))};
}

namespace {

// Shares a load between the points on either side of its place, by the lever rule. This keeps force
// and moment. The two shares are stiffer than a load at the place between the points. `moment`
// subtracts the excess.
void DistributeLoad(const PointSet& points, const PointSet::Place& place, const Vector3d& gradient,
                    const Matrix3d& hessian, TangentLoad& moment, PointDerivatives& out) {
  const auto add = [&](int q, double fraction) {
    const auto p = static_cast<std::size_t>(q);
    out.Touch(q);
    out.gradient[p] += fraction * gradient;
    if (out.with_hessian) out.hessian[p] += fraction * hessian;
  };
  const double piece_mm = points.PieceMm(place.point);
  const double before = place.before_mm / piece_mm;
  add(place.point, 1 - before);
  if (before == 0) return;
  if (place.point > 0) add(place.point - 1, before);
  moment.hessian -= before * (1 - before) * piece_mm * piece_mm * hessian;
}

}  // namespace

double Friction::Add(const PointSet& points, PointDerivatives& out) const {
  const Spots& on = on_curves_[static_cast<std::size_t>(points.among.curve)];
  double energy = 0;
  for (const std::size_t spot : on.acting) {
    const Anchor& anchor = anchors_[spot];
    const PointSet::Place place = PlaceOf(points, spot);
    const int q = place.point;
    if (q < 0 || anchor.limit_N == 0) continue;
    Vector3d s = points.PositionAt(place) - anchor.at;
    s -= s.dot(anchor.normal) * anchor.normal;
    RollingSlip rolling;
    if (!local_frames_.empty()) {
      rolling = RollingSlipAt(points, spot, q, anchor.normal);
      s += rolling.angle_rad * rolling.per_rad_mm;
    }
    const StickSlip law(anchor.limit_N, slip_mm_, s.squaredNorm());
    energy += law.energy_mJ;
    const Vector3d gradient = law.secant_N_mm * s;
    Matrix3d hessian = Matrix3d::Zero();
    if (out.with_hessian) {
      hessian =
          law.secant_N_mm * (Matrix3d::Identity() - anchor.normal * anchor.normal.transpose()) -
          law.softening_N_mm3 * s * s.transpose();
    }
    TangentLoad moment{q / points.per_segment, Vector3d::Zero(), Matrix3d::Zero()};
    DistributeLoad(points, place, gradient, hessian, moment, out);
    if (!local_frames_.empty()) {
      SpinLoad spin{.point = q,
                    .gradient = gradient.dot(rolling.per_rad_mm),
                    .hessian = 0,
                    .with_position = Vector3d::Zero(),
                    .before_mm = place.before_mm,
                    .instrument = InstrumentOf(spot)};
      if (out.with_hessian) {
        spin.with_position = hessian * rolling.per_rad_mm;
        spin.hessian = rolling.per_rad_mm.dot(spin.with_position);
      }
      out.on_spins.push_back(spin);
      moment.gradient += spin.gradient * rolling.area -
                         (points.radius_mm[static_cast<std::size_t>(q)] * rolling.angle_rad) *
                             anchor.normal.cross(gradient);
    } else if (moment.gradient.isZero(0) && (place.before_mm == 0 || !out.with_hessian)) {
      continue;
    }
    out.on_tangents.push_back(moment);
  }
  return energy;
}

void Friction::MoveSurfaces(const PointSet& points,
                            const std::array<SurfaceMove, kMostInstruments>& moves) {
  // Spots move along the wire with their instruments.
  if (std::all_of(moves.begin(), moves.end(),
                  [](const SurfaceMove& move) { return move.turn_rad == 0; })) {
    return;
  }
  FindPresses(points);
  for (const std::size_t spot : SpotsOn(points).pressed) {
    Anchor& anchor = anchors_[spot];
    const PointSet::Place place = PlaceOf(points, spot);
    if (!anchor.holds || place.point < 0) continue;
    const double turn_rad = moves[static_cast<std::size_t>(InstrumentOf(spot))].turn_rad;
    const Vector3d normal = presses_[spot].normal_N.normalized();
    Place(anchor.at - turn_rad * SurfacePerRad(points, place.point, normal), anchor);
  }
}

void Friction::End(const PointSet& points) {
  Spots& on = SpotsOn(points);
  for (const std::size_t spot : on.acting) {
    if (local_frames_.empty()) break;
    // Converts the turn into a displacement; the turn then restarts at zero.
    const PointSet::Place place = PlaceOf(points, spot);
    Anchor& anchor = anchors_[spot];
    if (place.point < 0 || anchor.limit_N == 0) continue;
    const RollingSlip rolling = RollingSlipAt(points, spot, place.point, anchor.normal);
    Place(anchor.at - rolling.angle_rad * rolling.per_rad_mm, anchor);
    local_frames_[spot] = LocalFrameOf(points, spot, place.point);
  }
  FindPresses(points);
  // A spot without contact forgets its anchor: it lifted off, slid into another instrument, or left
  // through the sheath.
  for (const std::size_t spot : on.holding) {
    if (!presses_[spot].touches) anchors_[spot].holds = false;
  }
  on.holding.clear();
  for (const std::size_t spot : on.pressed) {
    const PointSet::Place place = PlaceOf(points, spot);
    if (place.point < 0) {
      anchors_[spot].holds = false;
      continue;
    }
    on.holding.push_back(spot);
    Anchor& anchor = anchors_[spot];
    const Vector3d at = points.PositionAt(place);
    if (!anchor.holds) {
      anchor.holds = true;
      Place(at, anchor);
      continue;
    }
    Vector3d s = at - anchor.at;
    // Uses the contact plane of the part if there is one; the force then stays unchanged.
    const Vector3d normal =
        anchor.limit_N > 0 ? anchor.normal : presses_[spot].normal_N.normalized();
    s -= s.dot(normal) * normal;
    const double distance = s.norm();
    if (distance > slip_mm_) Place(at - (slip_mm_ / distance) * s, anchor);
  }
}

std::uint64_t Friction::Hash(std::uint64_t seed) const {
  for (const Spots& on : on_curves_) {
    for (const std::size_t spot : on.holding) {
      const Anchor& anchor = anchors_[spot];
      for (const double component : anchor.at) seed = HashDouble(component, seed);
      // A part that the budget interrupted continues with these values.
      if (anchor.limit_N == 0) continue;
      seed = HashDouble(anchor.limit_N, seed);
      for (const double component : anchor.normal) seed = HashDouble(component, seed);
    }
  }
  return seed;
}

namespace {

struct FrictionRegionSpec : RegionSpec {
  double factor = 1;
};

struct FrictionSpec : TableSpec {
  double coefficient = 0;
  double slip_mm = 0.005;
  std::vector<FrictionRegionSpec> regions;
};

const Keys<FrictionRegionSpec>& FrictionRegionKeys() {
  static const Keys<FrictionRegionSpec> keys =
      Keys<FrictionRegionSpec>()
          .Include(RegionKeys())
          .Required()
          .Number("factor", &FrictionRegionSpec::factor, 0, 20, "",
                  "factor on the coefficient of friction in the region");
  return keys;
}

const Keys<FrictionSpec>& FrictionKeys() {
  static const Keys<FrictionSpec> keys =
      Keys<FrictionSpec>()
          .Required()
          .Number("coefficient", &FrictionSpec::coefficient, 0, 2, "",
                  "coefficient of Coulomb friction on the wall, mu; an instrument may override it "
                  "(friction_coefficient)")
          .Number("slip_mm", &FrictionSpec::slip_mm, 1e-5, 0.1, "mm",
                  "displacement at which a sticking contact begins to slip")
          .Tables(
              "region", &FrictionSpec::regions, FrictionRegionKeys(), 0,
              "regions of the wall with other friction; a later region overrides an earlier one")
          .Example("coefficient = 0.08\n");
  return keys;
}

std::unique_ptr<Effect> MakeFriction(const FrictionSpec& spec, const EffectContext& context) {
  std::vector<Friction::RegionFactor> regions;
  for (const FrictionRegionSpec& wall : spec.regions) {
    regions.push_back({MakeRegion(wall, context), wall.factor});
  }
  return std::make_unique<Friction>(spec.coefficient, spec.slip_mm, context, std::move(regions));
}

}  // namespace

EffectKind FrictionKind() {
  return {.name = "friction",
          .summary = "Coulomb friction of the instruments on the wall, with stick and slip",
          .roles = "energy term",
          .keys = Any(FrictionKeys()),
          .make = MakeWith(MakeFriction)};
}

}  // namespace torquer::effects
