#include "host/simulator/core/contact_points.h"

#include <algorithm>
#include <array>

#include "host/simulator/core/wire_sections.h"

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
  if (wall.stiffness_field != nullptr) stiffness_N_mm2_.assign(last_.size(), wall.stiffness_N_mm2);
}

void ContactPoints::Forget() {
  for (Lookup& look : last_) look.free_mm = -1;
}

void ContactPoints::CopyFrom(const ContactPoints& twin) {
  last_ = twin.last_;
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

// True if the segment contains the tip of an instrument that does not lead. The half piece beyond
// its last point counts too.
bool ContactPoints::HasTip(int segment, const PointSet& points) const {
  const int last = (segment + 1) * points.per_segment - 1;
  const double end_mm = points.FromTipMm(last) - points.spacing_mm;
  const double begin_mm =
      points.FromTipMm(last) + points.per_segment * points.PieceMm(segment * points.per_segment);
  for (int k = points.instruments.first; k < points.instruments.last; ++k) {
    const double behind_mm = points.instruments.behind_mm[k];
    if (behind_mm > 0 && behind_mm >= end_mm && behind_mm <= begin_mm) return true;
  }
  return false;
}

// Radius of the outermost part of a point. Notes the parts if there are several.
double ContactPoints::PartRadius(int q, PointSet& points) const {
  constexpr double kRounding = 1e-9;
  const PointSet::Instruments& on = points.instruments;
  struct Reach {
    int instrument;
    double covers;
  };
  std::array<Reach, kMostInstruments> reaches;
  int count = 0;
  for (int k = on.first; k < on.last; ++k) {
    const double covers = on.behind_mm[k] > 0 ? points.CoverageOf(k, q) : 1;
    if (covers <= kRounding) continue;
    int m = count++;
    for (; m > 0 && reaches[m - 1].covers > covers; --m) reaches[m] = reaches[m - 1];
    reaches[m] = {k, covers};
  }
  const int segment_end = (q / points.per_segment + 1) * points.per_segment - 1;
  PointSet::Parted& parted = points.parted[points.parted_count];
  parted.point = q;
  parted.count = parted.touching = 0;
  parted.acts = 1;
  double before = 0;  // fraction of the length that the parts so far have
  for (int m = 0; m < count; ++m) {
    if (reaches[m].covers - before <= kRounding) continue;
    // The instruments from m on reach this part, and the others end before it.
    PointSet::Parted::Part part{.fraction = reaches[m].covers - before};
    for (int k = m; k < count; ++k) {
      const int instrument = reaches[k].instrument;
      const double radius_mm = SectionAt(stack_->instrument(instrument).sections(),
                                         std::max(0.0, points.FromTipOf(instrument, segment_end)))
                                   .radius_mm;
      if (radius_mm <= part.radius_mm) continue;
      part.radius_mm = radius_mm;
      part.instrument = instrument;
    }
    before = reaches[m].covers;
    if (parted.count > 0 && parted.parts[parted.count - 1].radius_mm == part.radius_mm) {
      parted.parts[parted.count - 1].fraction += part.fraction;
    } else {
      parted.parts[parted.count++] = part;
    }
  }
  if (parted.count > 1) ++points.parted_count;
  return parted.parts[0].radius_mm;
}

// Sets radius and stiffness of a near point with parts. The sum of its parts' energies is that of
// one spring, plus a constant.
void ContactPoints::TakeParts(double clearance_mm, int q, PointSet& points) const {
  if (points.parted_count == 0 || points.parted[points.parted_count - 1].point != q) return;
  PointSet::Parted& parted = points.parted[points.parted_count - 1];
  double first = 0;
  double second = 0;
  parted.acts = 0;
  parted.touching = 0;
  for (int m = 0; m < parted.count; ++m) {
    const PointSet::Parted::Part& part = parted.parts[m];
    const bool touches = part.radius_mm > clearance_mm;
    if (touches) ++parted.touching;
    if (m > 0 && !touches) break;
    parted.acts += part.fraction;
    first += part.fraction * part.radius_mm;
    second += part.fraction * part.radius_mm * part.radius_mm;
  }
  points.radius_mm[q] = first / parted.acts;
  points.parted_mJ += points.stiffness_N_mm2[q] * points.weight_mm[q] *
                      std::max(0.0, second - first * first / parted.acts) / 2;
  points.stiffness_N_mm2[q] *= parted.acts;
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
  const bool several = stack_ != nullptr && points.instruments.last - points.instruments.first > 1;
  points.parted_count = 0;
  points.parted_mJ = 0;
  std::size_t q = 0;
  for (int i = 0; i < n; ++i) {
    const double length = curve.SegmentLength(model_, i);
    const bool has_tip = several && HasTip(i, points);
    double radius = model_.radius_mm(n - 1 - i);
    double used_mm = (travel + radius) / lipschitz_;
    const double piece = length / per_segment;
    const double beyond = i + 1 < n ? points.spacing_mm : 0;
    for (int k = 1; k <= per_segment; ++k, ++q) {
      const Vector3d at =
          k == per_segment
              ? curve.nodes()[i + 1]
              : Vector3d(curve.nodes()[i] + (length * k / per_segment) * curve.tangents()[i]);
      points.position[q] = at;
      points.weight_mm[q] = k == per_segment ? (piece + beyond) / 2 : piece;
      if (has_tip) {
        radius = PartRadius(static_cast<int>(q), points);
        used_mm = (travel + radius) / lipschitz_;
      }
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
      look.free_mm = (sample.clearance_mm - kNearMm + travel) / lipschitz_;
      if (sample.clearance_mm >= radius + kNearMm) continue;
      points.near.push_back(static_cast<int>(q));
      points.stiffness_N_mm2[q] =
          stiffness_N_mm2_.empty() ? wall_.stiffness_N_mm2 : stiffness_N_mm2_[count - 1 - q];
      if (has_tip) TakeParts(sample.clearance_mm, static_cast<int>(q), points);
    }
  }
}

}  // namespace torquer
