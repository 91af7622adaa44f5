#include "host/simulator/core/wire_mechanics.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace torquer {

WireMechanics::WireMechanics(const WireModel& model, const ClearanceField& field,
                             const WallModel& wall, const std::vector<EnergyTerm*>& terms)
    : wall_(wall), terms_(terms) {
  curves_.emplace_back(model, field, wall, nullptr, 0);
}

WireMechanics::WireMechanics(const CombinedRods& rods, const ClearanceField& field,
                             const WallModel& wall, const std::vector<EnergyTerm*>& terms)
    : wall_(wall), terms_(terms) {
  const InstrumentStack& stack = rods.stack();
  for (int c = 0; c < stack.curves(); ++c) curves_.emplace_back(rods[c], field, wall, &stack, c);
  if (stack.curves() == 1 && !stack.clearance().touches_itself) return;
  rods_ = &rods;
  pairs_.emplace(stack, wall.points_per_segment);
  trial_pairs_.emplace(stack, wall.points_per_segment);
}

QuadraticModel WireMechanics::MakeQuadraticModel() const {
  const bool terms = !terms_.empty();
  QuadraticModel e;
  curves_.front().Reserve(terms, e);
  if (!pairs_) return e;
  e.around.resize(curves_.size() - 1);
  const int pieces = LumenPairs::PiecesPerSegment(wall_.points_per_segment);
  for (int c = 0; c < curves(); ++c) {
    const CurveMechanics& mechanics = curves_[c];
    CurveQuadraticModel& curve = e.curve(c);
    if (c > 0) mechanics.Reserve(terms, curve);
    const auto segments = static_cast<std::size_t>(mechanics.model().max_segments()) + 1;
    curve.touch_gradient.reserve(segments);
    curve.points.between.per_segment = pieces;
    curve.points.among.inside_mm2.reserve(mechanics.points().capacity());
    if (!SlidesInLumen()) continue;
    const std::size_t places = segments * static_cast<std::size_t>(pieces);
    curve.points.between.lumen.reserve(places);
    curve.points.between.beside.reserve(places);
    curve.derivatives.in_lumen.reserve(places);
    curve.derivatives.beside.reserve(places);
    std::size_t crossing = 0;
    for (const LumenPairs& pairs : pairs_->of_curves()) {
      if (!pairs.ordered && pairs.inner == c) crossing += pairs.spots.capacity();
    }
    curve.points.between.crossing.reserve(crossing);
    curve.derivatives.crossing.reserve(crossing);
  }
  for (const LumenPairs& pairs : pairs_->of_curves()) e.between.emplace_back().Reserve(pairs);
  return e;
}

bool WireMechanics::SlidesInLumen() const {
  return std::any_of(terms_.begin(), terms_.end(), [](EnergyTerm* term) {
    const BetweenTerm* between = term->between_term();
    return between != nullptr && between->SlidesInLumen();
  });
}

bool WireMechanics::has_beside() const {
  if (!pairs_) return false;
  const std::vector<LumenPairs>& all = pairs_->of_curves();
  return std::any_of(all.begin(), all.end(), [](const LumenPairs& pairs) { return pairs.beside; });
}

void WireMechanics::PairCurves(const WireState& state) {
  if (pairs_) pairs_->Find(*rods_, state, SlidesInLumen());
}

std::int64_t WireMechanics::lookups() const {
  std::int64_t lookups = 0;
  for (const CurveMechanics& curve : curves_) lookups += curve.points().lookups();
  return lookups;
}

void WireMechanics::CopyFrom(const WireMechanics& twin) {
  for (std::size_t c = 0; c < curves_.size(); ++c) {
    curves_[c].points().CopyFrom(twin.curves_[c].points());
  }
  pairs_ = twin.pairs_;
}

std::uint64_t WireMechanics::Hash(std::uint64_t seed) const {
  return pairs_ ? pairs_->Hash(seed) : seed;
}

BetweenCurves::Geometry WireMechanics::GeometryOf(int curve, const WireState& state,
                                                  const QuadraticModel& at) const {
  return {state.curve(curve), model(curve), at.curve(curve).frames};
}

void WireMechanics::BuildBetween(const WireState& state, QuadraticModel& out) const {
  const bool slides = SlidesInLumen();
  for (int c = 0; c < curves(); ++c) {
    out.curve(c).points.between.lumen.clear();
    out.curve(c).points.between.beside.clear();
    out.curve(c).points.between.crossing.clear();
  }
  for (std::size_t k = 0; k < out.between.size(); ++k) {
    const LumenPairs& pairs = pairs_->of_curves()[k];
    PointSet& points = out.curve(pairs.inner).points;
    out.between[k].Place(pairs, rods_->stack().clearance().stiffness_N_mm2,
                         GeometryOf(pairs.inner, state, out), GeometryOf(pairs.outer, state, out),
                         !slides          ? nullptr
                         : !pairs.ordered ? &points.between.crossing
                         : pairs.beside   ? &points.between.beside
                                          : &points.between.lumen);
    out.energy_mJ += out.between[k].energy_mJ;
  }
}

// The spin gradient is added to the segments; all other terms go to `between`.
void WireMechanics::AddSlideLoads(const WireState& state, QuadraticModel& out) const {
  std::array<std::size_t, kMostInstruments> first_contact = {};  // of the next pair that crosses
  for (std::size_t k = 0; k < out.between.size(); ++k) {
    BetweenCurves& between = out.between[k];
    const LumenPairs& pairs = pairs_->of_curves()[k];
    CurveQuadraticModel& inner = out.curve(pairs.inner);
    std::size_t& first = first_contact[pairs.inner];
    const PointSet::Between& contacts = inner.points.between;
    const PointDerivatives& loads = inner.derivatives;
    between.TakeSlides(pairs, GeometryOf(pairs.inner, state, out),
                       GeometryOf(pairs.outer, state, out), contacts.lumen, first,
                       !pairs.ordered ? loads.crossing
                       : pairs.beside ? loads.beside
                                      : loads.in_lumen);
    if (!pairs.ordered) first += pairs.spots.size();
    if (model().spins() == 0) continue;
    for (const BetweenCurves::Slide& slide : between.slides) {
      const SegmentPair& on = between.groups[slide.group];
      AddSpinGradient(pairs.inner, on.inner, slide.inner,
                      slide.inner_spin_mm.dot(slide.load.gradient), out);
      AddSpinGradient(pairs.outer, on.outer, slide.outer,
                      slide.outer_spin_mm.dot(slide.load.gradient), out);
    }
  }
}

// Adds to the gradient by the spin of an instrument on a segment.
void WireMechanics::AddSpinGradient(int curve, int segment, int instrument, double gradient_mJ,
                                    QuadraticModel& out) const {
  CurveQuadraticModel& at = out.curve(curve);
  if (model(curve).twists()) {
    at.twists[segment].gradient_distal += gradient_mJ;
  } else {
    at.stack[segment].gradient_distal[instrument - model(curve).first_spin()] += gradient_mJ;
  }
}

// Sets the points' data about the other curves, for each curve.
void WireMechanics::RelateCurves(const WireState& state, QuadraticModel& out) const {
  const int farthest = state.FarthestCurve();
  for (int c = 0; c < curves(); ++c) {
    PointSet& points = out.curve(c).points;
    points.among.is_farthest = c == farthest;
    points.among.beside_farthest =
        rods_->stack().AreBeside(std::min(c, farthest), std::max(c, farthest));
    points.among.behind_farthest_mm =
        state.curve(farthest).insertion_mm() - state.curve(c).insertion_mm();
    if (c > 0) FindInside(state, c, points);
  }
}

// Squared radius of the curves within a curve. For two curves, it is that of a section of the same
// area.
void WireMechanics::FindInside(const WireState& state, int curve, PointSet& points) const {
  points.among.inside_mm2.assign(points.position.size(), 0);
  for (int inner = 0; inner < curve; ++inner) {
    if (rods_->stack().CurveAround(inner) != curve) continue;
    const double behind_mm = state.curve(curve).insertion_mm() - state.curve(inner).insertion_mm();
    for (int q = 0; q < points.size(); ++q) {
      const double coverage = points.CoverageUpTo(behind_mm, q);
      if (coverage == 0) continue;
      const double from_tip_mm = std::max(0.0, points.FromTipMm(q) - behind_mm);
      const double radius_mm =
          model(inner).radius_mm(static_cast<int>(from_tip_mm / model(inner).segment_mm()));
      points.among.inside_mm2[q] += coverage * radius_mm * radius_mm;
    }
  }
}

void WireMechanics::AddTerms(const WireState& state, QuadraticModel& out) const {
  for (int c = 0; c < curves(); ++c) {
    CurveQuadraticModel& curve = out.curve(c);
    curve.derivatives.Clear(curve.points.position.size());
  }
  for (const EnergyTerm* term : terms_) {
    for (int c = 0; c < curves(); ++c) {
      CurveQuadraticModel& curve = out.curve(c);
      const double added_mJ = term->Add(curve.points, curve.derivatives);
      out.energy_mJ += added_mJ;
      if (term->Dissipates()) out.dissipated_mJ += added_mJ;
    }
  }
  for (int c = 0; c < curves(); ++c) {
    const CurveMechanics& mechanics = curves_[c];
    if (mechanics.model().spins() > 0) mechanics.AddSpinLoads(state.curve(c), out.curve(c));
  }
  if (pairs_) AddSlideLoads(state, out);
}

void WireMechanics::BuildAll(const WireState& state, bool with_hessian, QuadraticModel& out) {
  out.dissipated_mJ = 0;
  for (int c = 0; c < curves(); ++c) {
    const double in_lumen_mm = pairs_ ? pairs_->in_lumen_mm(c) : 0;
    CurveQuadraticModel& curve = out.curve(c);
    curves_[c].BuildModel(state.curve(c), in_lumen_mm, with_hessian, curve);
    if (c == 0) continue;
    out.energy_mJ += curve.energy_mJ;
    out.max_penetration_mm = std::max(out.max_penetration_mm, curve.max_penetration_mm);
  }
  if (pairs_) {
    RelateCurves(state, out);
    BuildBetween(state, out);
  }
  if (!terms_.empty()) AddTerms(state, out);
  SumTrueGradient(state, out);
}

// Sums the contact between curves by the segments of each.
void WireMechanics::SumTouches(const WireState& state, QuadraticModel& out) {
  for (int c = 0; c < state.curves(); ++c) {
    out.curve(c).touch_gradient.assign(state.curve(c).segments(),
                                       Eigen::Matrix<double, 5, 1>::Zero());
  }
  for (BetweenCurves& between : out.between) {
    between.SumTouching();
    for (std::size_t k = 0; k < between.groups.size(); ++k) {
      const BetweenCurves::Terms& terms = between.terms[k];
      if (!terms.any) continue;
      const SegmentPair& on = between.groups[k];
      out.curve(between.inner).touch_gradient[on.inner] += terms.gradient.head<5>();
      out.curve(between.outer).touch_gradient[on.outer] += terms.gradient.tail<5>();
    }
  }
}

void WireMechanics::SumTrueGradient(const WireState& state, QuadraticModel& out) const {
  if (pairs_) SumTouches(state, out);
  for (int c = 0; c < curves(); ++c) {
    CurveQuadraticModel& curve = out.curve(c);
    curves_[c].SumTrueGradient(state.curve(c), curve);
    if (c > 0) out.residual = std::max(out.residual, curve.residual);
  }
}

void WireMechanics::SumActiveLoads(const WireState& state, int curve,
                                   const std::vector<std::uint8_t>& active,
                                   QuadraticModel& out) const {
  curves_[curve].SumLoads(
      state.curve(curve), [&active](std::size_t k) { return active[k] != 0; }, out.curve(curve));
}

void WireMechanics::BuildModel(const WireState& state, QuadraticModel& out) {
  BuildAll(state, true, out);
}

void WireMechanics::BuildGradient(const WireState& state, QuadraticModel& out) {
  BuildAll(state, false, out);
}

}  // namespace torquer
