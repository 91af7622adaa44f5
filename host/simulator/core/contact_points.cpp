#include "host/simulator/core/contact_points.h"

#include <algorithm>

namespace torquer {

using Eigen::Vector3d;

ContactPoints::ContactPoints(const WireModel& model, const ClearanceField& field,
                             const WallModel& wall, const InstrumentStack* stack)
    : model_(model),
      stack_(stack),
      field_(field),
      wall_(wall),
      lipschitz_(field.LipschitzBound()),
      last_(static_cast<std::size_t>(model.max_segments() + 1) *
            static_cast<std::size_t>(wall.points_per_segment)) {
  Forget();
  radius_mm_.resize(static_cast<std::size_t>(model.max_segments()) + 1);
  TakeRadii();
  if (wall.by_place != nullptr) stiffness_N_mm2_.assign(last_.size(), wall.stiffness_N_mm2);
}

void ContactPoints::Forget() {
  for (Lookup& look : last_) look.free_mm = -1;
}

void ContactPoints::TakeRadii() {
  if (stack_ != nullptr) {
    Forget();  // the instrument that touches the wall at a point may have changed, too
    return;
  }
  const auto per_segment = static_cast<std::size_t>(wall_.points_per_segment);
  for (std::size_t j = 0; j < radius_mm_.size(); ++j) {
    const double radius_mm = model_.radius_mm(static_cast<int>(j));
    const double grown_mm = radius_mm - radius_mm_[j];
    radius_mm_[j] = radius_mm;
    if (grown_mm <= 0) continue;
    for (std::size_t q = j * per_segment; q < (j + 1) * per_segment; ++q) {
      last_[q].free_mm -= grown_mm / lipschitz_;
    }
  }
}

void ContactPoints::CopyFrom(const ContactPoints& twin) {
  last_ = twin.last_;
  radius_mm_ = twin.radius_mm_;
  stiffness_N_mm2_ = twin.stiffness_N_mm2_;
  stiffness_travel_mm_ = twin.stiffness_travel_mm_;
}

void ContactPoints::Reserve(PointSet& points) const {
  points.per_segment = wall_.points_per_segment;
  points.position.reserve(last_.size());
  points.weight_mm.reserve(last_.size());
  points.radius_mm.reserve(last_.size());
  points.touches.reserve(last_.size());
  points.clearance.reserve(last_.size());
  points.stiffness_N_mm2.reserve(last_.size());
  points.near.reserve(last_.size());
  const auto segments = static_cast<std::size_t>(model_.max_segments()) + 1;
  for (PointSet::Turns* const turns : {&points.turns, &points.second_turns}) {
    if (model_.spins() > 0) turns->normals.reserve(segments);
    if (model_.stack_twists()) turns->angles_rad.reserve(segments);
    if (stack_ == nullptr) break;
  }
  if (stack_ != nullptr) {
    points.on_second.reserve(last_.size());
    points.tangent.reserve(last_.size());
    points.covered.reserve(last_.size());
    points.covered_radius_mm.reserve(last_.size());
  }
}

// Places the points of the curve that does not touch the wall.
void ContactPoints::PlaceCovered(const WireState& state, PointSet& points) const {
  const WireState& second = *state.second();
  const int per_segment = points.per_segment;
  const auto count = static_cast<std::size_t>(second.segments() * per_segment);
  points.covered.resize(count);
  points.covered_radius_mm.resize(count);
  for (std::size_t q = 0; q < count; ++q) {
    const auto i = q / static_cast<std::size_t>(per_segment);
    const int k = static_cast<int>(q) % per_segment + 1;
    const bool on_second = !points.OnSecond(static_cast<int>(q));
    const WireState& curve = on_second ? second : state;
    const WireModel& rod = on_second ? *stack_->second_rod() : model_;
    const double length_mm = state.SegmentLength(model_, static_cast<int>(i));
    points.covered[q] = curve.nodes()[i] + (length_mm * k / per_segment) * curve.tangents()[i];
    points.covered_radius_mm[q] = rod.radius_mm(curve.segments() - 1 - static_cast<int>(i));
  }
}

// At points of both curves the outer one touches the wall. The state outlives what it
// gives. NOLINTBEGIN(bugprone-return-const-ref-from-parameter)
const WireState& ContactPoints::CurveAt(const WireState& state, int q) const {
  const WireState* const second = state.second();
  if (stack_ == nullptr || second == nullptr || state.outer_leads()) return state;
  const int per_segment = wall_.points_per_segment;
  if (q / per_segment >= second->segments()) return state;
  const double behind_mm = state.insertion_mm() - stack_->SecondReach(state.places());
  const int from_tip = state.segments() * per_segment - 1 - q;
  return from_tip * model_.segment_mm() >= behind_mm * per_segment ? *second : state;
}
// NOLINTEND(bugprone-return-const-ref-from-parameter)

void ContactPoints::TakeStiffness(const WireState& state) {
  if (wall_.by_place == nullptr) return;
  stiffness_travel_mm_ = field_.TravelMm();
  const int per_segment = wall_.points_per_segment;
  std::size_t q = static_cast<std::size_t>(state.segments() * per_segment);
  for (int i = 0; i < state.segments(); ++i) {
    const double length = state.SegmentLength(model_, i);
    for (int k = 1; k <= per_segment; ++k) {
      const WireState& curve = CurveAt(state, i * per_segment + k - 1);
      stiffness_N_mm2_[--q] =
          wall_.by_place->At(curve.nodes()[i] + (length * k / per_segment) * curve.tangents()[i]);
    }
  }
}

void ContactPoints::Place(const WireState& state, bool with_hessian, PointSet& points) {
  const int n = state.segments();
  const int per_segment = wall_.points_per_segment;
  const auto count = static_cast<std::size_t>(n * per_segment);
  points.per_segment = per_segment;
  points.position.resize(count);
  points.weight_mm.resize(count);
  points.radius_mm.resize(count);
  points.touches.resize(count);
  points.clearance.resize(count);
  points.stiffness_N_mm2.resize(count);
  points.near.clear();
  points.start = state.nodes().front();
  const auto take_turns = [this](const WireState& curve, PointSet::Turns& turns) {
    if (model_.spins() > 0) turns.normals = curve.normals();
    turns.angles_rad = curve.turns_rad();
  };
  take_turns(state, points.turns);
  if (stack_ != nullptr) {
    take_turns(*state.second(), points.second_turns);
    points.first_outer = stack_->clearance().first_outer;
    points.outer_leads = state.outer_leads();
  }
  points.instruments = state.places().size();
  points.spacing_mm = model_.segment_mm() / per_segment;
  points.first_spacing_mm = state.first_segment_mm() / per_segment;
  for (int k = 0; k < points.instruments; ++k) {
    points.behind_mm[static_cast<std::size_t>(k)] =
        state.insertion_mm() - state.places()[k].insertion_mm;
  }
  const double travel = field_.TravelMm();
  if (travel != stiffness_travel_mm_) TakeStiffness(state);
  const double used_mm = travel / lipschitz_;
  if (stack_ != nullptr) {
    points.on_second.resize(count);
    points.tangent.resize(count);
  }
  std::size_t q = 0;
  for (int i = 0; i < n; ++i) {
    const double length = state.SegmentLength(model_, i);
    double radius = model_.radius_mm(n - 1 - i);
    const double piece = length / per_segment;
    const double beyond = i + 1 < n ? points.spacing_mm : 0;
    for (int k = 1; k <= per_segment; ++k, ++q) {
      const WireState& curve = CurveAt(state, static_cast<int>(q));
      const Vector3d at =
          k == per_segment
              ? curve.nodes()[static_cast<std::size_t>(i) + 1]
              : Vector3d(curve.nodes()[i] + (length * k / per_segment) * curve.tangents()[i]);
      if (stack_ != nullptr) {
        const bool second = &curve != &state;
        points.on_second[q] = second;
        points.tangent[q] = curve.tangents()[i];
        radius = second ? stack_->second_rod()->radius_mm(curve.segments() - 1 - i)
                        : model_.radius_mm(n - 1 - i);
      }
      points.position[q] = at;
      points.weight_mm[q] = k == per_segment ? (piece + beyond) / 2 : piece;
      points.radius_mm[q] = radius;
      Lookup& look = last_[count - 1 - q];
      const double free = look.free_mm - used_mm;
      if (free > 0 && (at - look.at).squaredNorm() < free * free) {
        points.touches[q] = 0;
        continue;
      }
      ++lookups_done_;
      ClearanceSample& sample = points.clearance[q];
      if (with_hessian) {
        field_.EvaluateHessian(at, sample);
      } else {
        field_.EvaluateGradient(at, sample);
      }
      points.touches[q] = sample.clearance_mm < radius;
      look.at = at;
      look.free_mm = (sample.clearance_mm - radius - kNearMm + travel) / lipschitz_;
      if (sample.clearance_mm >= radius + kNearMm) continue;
      points.near.push_back(static_cast<int>(q));
      points.stiffness_N_mm2[q] =
          stiffness_N_mm2_.empty() ? wall_.stiffness_N_mm2 : stiffness_N_mm2_[count - 1 - q];
    }
  }
  if (stack_ != nullptr) PlaceCovered(state, points);
}

}  // namespace torquer
