#include "host/simulator/core/contact_points.h"

#include <algorithm>

namespace torquer {

using Eigen::Vector3d;

ContactPoints::ContactPoints(const WireModel& model, const ClearanceField& field,
                             const WallModel& wall, const InstrumentStack* stack, int curve)
    : model_(model),
      stack_(stack),
      number_(curve),
      field_(field),
      wall_(wall),
      lipschitz_(field.LipschitzBound()),
      last_(static_cast<std::size_t>(model.max_segments() + 1) *
            static_cast<std::size_t>(wall.points_per_segment)) {
  Forget();
  radius_mm_.resize(model.max_segments() + 1);
  UpdateRadii();
  if (wall.stiffness_field != nullptr) stiffness_N_mm2_.assign(last_.size(), wall.stiffness_N_mm2);
}

void ContactPoints::Forget() {
  for (Lookup& look : last_) look.free_mm = -1;
}

void ContactPoints::UpdateRadii() {
  const int per_segment = wall_.points_per_segment;
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
  if (model_.spins() > 0) points.instruments.normals.reserve(segments);
  if (model_.stack_twists()) points.instruments.angles_rad.reserve(segments);
}

void ContactPoints::SampleStiffness(const Curve& curve) {
  if (wall_.stiffness_field == nullptr) return;
  stiffness_travel_mm_ = field_.TravelMm();
  const int per_segment = wall_.points_per_segment;
  std::size_t q = static_cast<std::size_t>(curve.segments() * per_segment);
  for (int i = 0; i < curve.segments(); ++i) {
    const double length = curve.SegmentLength(model_, i);
    for (int k = 1; k <= per_segment; ++k) {
      stiffness_N_mm2_[--q] = wall_.stiffness_field->At(
          curve.nodes()[i] + (length * k / per_segment) * curve.tangents()[i]);
    }
  }
}

// Sets the points' data about the instruments on the curve.
void ContactPoints::PlaceInstruments(const Curve& curve, double in_lumen_mm,
                                     PointSet& points) const {
  constexpr double kRoundingMm = 1e-9;
  const InstrumentStack::Range range = stack_ == nullptr
                                           ? InstrumentStack::Range{0, curve.poses().size()}
                                           : stack_->OnCurve(number_);
  points.among.curve = number_;
  points.instruments.first = range.first;
  points.instruments.last = range.last;
  points.start = curve.nodes().front();
  points.spacing_mm = model_.segment_mm() / points.per_segment;
  points.first_spacing_mm = curve.first_segment_mm() / points.per_segment;
  for (int k = range.first; k < range.last; ++k) {
    points.instruments.behind_mm[k] = curve.insertion_mm() - curve.poses()[k].insertion_mm;
  }
  if (model_.spins() > 0) points.instruments.normals = curve.normals();
  points.instruments.angles_rad = curve.turns_rad();
  points.among.in_lumen = 0;
  if (in_lumen_mm <= 0) return;
  const int count = points.size();
  const double inside_mm = in_lumen_mm + kRoundingMm;
  const auto arc_mm = [&](int q) { return curve.insertion_mm() - points.FromTipMm(q); };
  while (points.among.in_lumen < count && arc_mm(points.among.in_lumen) <= inside_mm)
    ++points.among.in_lumen;
}

void ContactPoints::Place(const Curve& curve, double in_lumen_mm, bool with_hessian,
                          PointSet& points) {
  const int n = curve.segments();
  const int per_segment = wall_.points_per_segment;
  const int count = n * per_segment;
  points.per_segment = per_segment;
  points.position.resize(count);
  points.weight_mm.resize(count);
  points.radius_mm.resize(count);
  points.touches.resize(count);
  points.clearance.resize(count);
  points.stiffness_N_mm2.resize(count);
  points.near.clear();
  PlaceInstruments(curve, in_lumen_mm, points);
  const double travel = field_.TravelMm();
  if (travel != stiffness_travel_mm_) SampleStiffness(curve);
  const double used_mm = travel / lipschitz_;
  std::size_t q = 0;
  for (int i = 0; i < n; ++i) {
    const double length = curve.SegmentLength(model_, i);
    const double radius = model_.radius_mm(n - 1 - i);
    const double piece = length / per_segment;
    const double beyond = i + 1 < n ? points.spacing_mm : 0;
    for (int k = 1; k <= per_segment; ++k, ++q) {
      const Vector3d at =
          k == per_segment
              ? curve.nodes()[i + 1]
              : Vector3d(curve.nodes()[i] + (length * k / per_segment) * curve.tangents()[i]);
      points.position[q] = at;
      points.weight_mm[q] = k == per_segment ? (piece + beyond) / 2 : piece;
      points.radius_mm[q] = radius;
      if (static_cast<int>(q) < points.among.in_lumen) {
        points.touches[q] = 0;
        continue;
      }
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
}

}  // namespace torquer
