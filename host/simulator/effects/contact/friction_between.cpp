#include "host/simulator/effects/contact/friction_between.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/core/hash.h"
#include "host/simulator/effects/contact/stick_slip.h"

namespace torquer::effects {

namespace {

// Turn of an instrument in another one, at a segment.
double TurnIn(const PointSet& points, int segment, int inner, int outer) {
  const PerInstrument& turns = points.instruments.angles_rad[static_cast<std::size_t>(segment)];
  return turns[static_cast<std::size_t>(inner)] - turns[static_cast<std::size_t>(outer)];
}

}  // namespace

FrictionBetween::FrictionBetween(double coefficient, double slip_mm, const EffectContext& context)
    : slip_mm_(slip_mm), stack_(*context.stack) {
  sliding_.coefficient = coefficient;
  if (stack_.curves() > 1 || stack_.clearance().touches_itself) {
    in_lumen_.emplace(coefficient, slip_mm, context);
  }
  on_curves_.resize(static_cast<std::size_t>(stack_.curves()));
  if (!stack_.empty_rod().stack_twists()) return;
  for (OnCurve& on : on_curves_) {
    on.anchors.resize(static_cast<std::size_t>(context.wire.max_segments()) + 1);
  }
}

void FrictionBetween::CopyFrom(const Effect& twin) {
  const auto& from = dynamic_cast<const FrictionBetween&>(twin);
  sliding_ = from.sliding_;
  in_lumen_ = from.in_lumen_;
  on_curves_ = from.on_curves_;
}

void FrictionBetween::Reset() {
  sliding_.direction = {};
  if (in_lumen_) in_lumen_->Reset();
  for (OnCurve& on : on_curves_) {
    on.anchors.assign(on.anchors.size(), Anchors());
    on.anchored = 0;
  }
}

void FrictionBetween::Begin(const PointSet& points) {
  if (in_lumen_) in_lumen_->Begin(points);
  OnCurve& on = AnchorsOn(points);
  if (on.anchors.empty()) return;
  const int segments = points.segments();
  const bool known = !points.between.pressed_N.empty();  // otherwise the last values remain
  for (int i = 0; i < segments; ++i) {
    const int last = (i + 1) * points.per_segment - 1;
    const double from_tip_mm = points.FromTipMm(last);
    Anchors& anchors = on.At(points, i);
    int inner = -1;
    for (int k = points.instruments.first; k < points.instruments.last; ++k) {
      const double behind_mm = points.instruments.behind_mm[static_cast<std::size_t>(k)];
      Anchor& own = anchors[static_cast<std::size_t>(k)];
      if (from_tip_mm < behind_mm) {
        own = Anchor();
        continue;
      }
      if (inner >= 0) {
        Anchor& anchor = anchors[static_cast<std::size_t>(inner)];
        if (anchor.outer != k) {
          anchor = Anchor();
          anchor.outer = k;
          anchor.turn_rad = TurnIn(points, i, inner, k);
        }
        if (known) {
          anchor.limit_N =
              sliding_.coefficient *
              points.between
                  .pressed_N[static_cast<std::size_t>(i)][static_cast<std::size_t>(inner)];
        }
        anchor.radius_mm =
            SectionAt(stack_.instrument(inner).sections(),
                      from_tip_mm - points.instruments.behind_mm[static_cast<std::size_t>(inner)])
                .radius_mm;
      }
      inner = k;
    }
    if (inner >= 0)
      anchors[static_cast<std::size_t>(inner)] = Anchor();  // the outermost has no anchor
  }
  on.anchored = segments;
}

double FrictionBetween::Add(const PointSet& points, PointDerivatives& out) const {
  double energy_mJ = in_lumen_ ? in_lumen_->Add(points, out) : 0;
  const OnCurve& on = on_curves_[static_cast<std::size_t>(points.among.curve)];
  if (on.anchors.empty()) return energy_mJ;
  for (int i = 0; i < std::min(points.segments(), on.anchored); ++i) {
    const Anchors& anchors = on.At(points, i);
    for (int k = points.instruments.first; k < points.instruments.last; ++k) {
      const Anchor& anchor = anchors[static_cast<std::size_t>(k)];
      if (anchor.outer < 0 || anchor.limit_N == 0) continue;
      const double r = anchor.radius_mm;
      const double around_mm = r * (TurnIn(points, i, k, anchor.outer) - anchor.turn_rad);
      const StickSlip law(anchor.limit_N, slip_mm_,
                          anchor.along_mm * anchor.along_mm + around_mm * around_mm);
      energy_mJ += law.energy_mJ;
      out.between.push_back(
          {.segment = i,
           .inner = k,
           .outer = anchor.outer,
           .gradient = r * law.secant_N_mm * around_mm,
           .hessian = r * r * (law.secant_N_mm - law.softening_N_mm3 * around_mm * around_mm)});
    }
  }
  return energy_mJ;
}

void FrictionBetween::MoveSurfaces(const PointSet& points,
                                   const std::array<SurfaceMove, kMostInstruments>& moves) {
  constexpr double kStillMm = 1e-9;
  const auto slid_mm = [&moves](std::size_t inner, std::size_t outer) {
    return moves[inner].along_mm - moves[outer].along_mm;
  };
  const auto first = static_cast<std::size_t>(points.instruments.first);
  const auto count = static_cast<std::size_t>(points.instruments.last);
  for (std::size_t k = first; k < count; ++k) {
    for (std::size_t m = k + 1; m < count; ++m) {
      if (std::abs(slid_mm(k, m)) > kStillMm) sliding_.direction[k][m] = slid_mm(k, m) > 0 ? 1 : -1;
    }
  }
  if (in_lumen_) in_lumen_->MoveSurfaces(points, moves);
  OnCurve& on = AnchorsOn(points);
  if (on.anchors.empty()) return;
  // Twists that slide along also cause turns. Their way, r times a rate of twist, is far less than
  // the way along and is neglected.
  for (int i = 0; i < std::min(points.segments(), on.anchored); ++i) {
    Anchors& anchors = on.At(points, i);
    for (std::size_t k = first; k < count; ++k) {
      if (anchors[k].outer < 0) continue;
      anchors[k].along_mm += slid_mm(k, static_cast<std::size_t>(anchors[k].outer));
    }
  }
}

void FrictionBetween::End(const PointSet& points) {
  if (in_lumen_) in_lumen_->End(points);
  OnCurve& on = AnchorsOn(points);
  if (on.anchors.empty()) return;
  for (int i = 0; i < std::min(points.segments(), on.anchored); ++i) {
    Anchors& anchors = on.At(points, i);
    for (int k = points.instruments.first; k < points.instruments.last; ++k) {
      Anchor& anchor = anchors[static_cast<std::size_t>(k)];
      if (anchor.outer < 0) continue;
      const double turn_rad = TurnIn(points, i, k, anchor.outer);
      const double around_mm = anchor.radius_mm * (turn_rad - anchor.turn_rad);
      const double distance = std::hypot(anchor.along_mm, around_mm);
      if (distance <= slip_mm_) continue;
      anchor.along_mm *= slip_mm_ / distance;
      anchor.turn_rad = turn_rad - slip_mm_ / distance * around_mm / anchor.radius_mm;
    }
  }
  // Segments that left through the sheath return in another position, so their anchors are cleared.
  for (int k = points.segments(); k < on.anchored; ++k) {
    on.anchors[static_cast<std::size_t>(k)] = Anchors();
  }
  on.anchored = std::min(on.anchored, points.segments());
}

std::uint64_t FrictionBetween::Hash(std::uint64_t seed) const {
  if (in_lumen_) seed = in_lumen_->Hash(seed);
  for (const auto& ways : sliding_.direction) {
    for (const int way : ways) seed = HashDouble(way, seed);
  }
  for (const OnCurve& on : on_curves_) {
    for (int i = 0; i < on.anchored; ++i) {
      for (const Anchor& anchor : on.anchors[static_cast<std::size_t>(i)]) {
        if (anchor.outer < 0) continue;
        for (const double value : {anchor.along_mm, anchor.turn_rad, anchor.limit_N}) {
          seed = HashDouble(value, seed);
        }
      }
    }
  }
  return seed;
}

namespace {

struct FrictionBetweenSpec : TableSpec {
  double coefficient = 0;
  double slip_mm = 0.005;
};

const Keys<FrictionBetweenSpec>& FrictionBetweenKeys() {
  static const Keys<FrictionBetweenSpec> keys =
      Keys<FrictionBetweenSpec>()
          .Required()
          .Number("coefficient", &FrictionBetweenSpec::coefficient, 0, 2, "",
                  "coefficient of Coulomb friction, mu, between an instrument and the one around "
                  "it, one beside it, or itself")
          .Number("slip_mm", &FrictionBetweenSpec::slip_mm, 1e-5, 0.1, "mm",
                  "displacement at which a sticking contact begins to slip")
          .Example("coefficient = 0.05\n");
  return keys;
}

std::unique_ptr<Effect> MakeFrictionBetween(const FrictionBetweenSpec& spec,
                                            const EffectContext& context) {
  if (context.instruments.size() < 2 && !context.stack->clearance().touches_itself) {
    spec.origin.Refuse("coefficient",
                       "this scene has one instrument that does not touch itself, so nothing rubs "
                       "between; add a second [[instrument]] or [effects.self_contact], or remove "
                       "[effects.friction_between]");
  }
  return std::make_unique<FrictionBetween>(spec.coefficient, spec.slip_mm, context);
}

}  // namespace

EffectKind FrictionBetweenKind() {
  return {.name = "friction_between",
          .summary =
              "Coulomb friction between instruments, with stick and slip; it acts on the hands "
              "and, with torsion, on the twist",
          .roles = "energy term",
          .keys = Any(FrictionBetweenKeys()),
          .make = MakeWith(MakeFrictionBetween)};
}

}  // namespace torquer::effects
