#include "host/simulator/core/stack/instrument_stack.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "host/simulator/core/stack/combined_rods.h"

namespace torquer {

namespace {

void CheckTogether(const std::vector<WireModel>& instruments, const Clearance& clearance) {
  if (instruments.empty() || instruments.size() > static_cast<std::size_t>(kMostInstruments)) {
    throw std::invalid_argument("a stack has " + std::to_string(instruments.size()) +
                                " instruments; give 1 to " + std::to_string(kMostInstruments));
  }
  if (instruments.size() == 1) return;
  const WireModel& first = instruments.front();
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    const WireModel& model = instruments[k];
    const bool enters_together = model.sheath().point_mm == first.sheath().point_mm &&
                                 model.sheath().direction == first.sheath().direction;
    if (model.segment_mm() != first.segment_mm() || model.law() != first.law() ||
        (!enters_together && !clearance.is_beside[k])) {
      throw std::invalid_argument("instruments of a stack need the same segments, law and sheath");
    }
    if (model.twists() != first.twists()) {
      throw std::invalid_argument("of instruments within each other all twist, or none");
    }
  }
}

double LargestRadius(const WireModel& model) {
  double radius_mm = 0;
  for (int j = 0; j <= model.max_segments(); ++j) {
    radius_mm = std::max(radius_mm, model.radius_mm(j));
  }
  return radius_mm;
}

// Checks that the instruments beside others enter within the lumen of instrument `k`.
void CheckEntries(const std::vector<WireModel>& instruments, const Clearance& clearance,
                  std::size_t k) {
  const Sheath& own = instruments[k].sheath();
  for (std::size_t j = 0; j < k; ++j) {
    if (!clearance.is_beside[j]) continue;
    const Eigen::Vector3d apart = instruments[j].sheath().point_mm - own.point_mm;
    const double across_mm = (apart - apart.dot(own.direction) * own.direction).norm();
    const double most_mm = clearance.lumen_radius_mm[k] - LargestRadius(instruments[j]);
    if (across_mm <= most_mm) continue;
    throw std::invalid_argument("an instrument enters " + std::to_string(across_mm) +
                                " mm beside the axis of the instrument around it; it must be at "
                                "most " +
                                std::to_string(most_mm) + " mm");
  }
}

void CheckRoom(const std::vector<WireModel>& instruments, const Clearance& clearance) {
  double beside_mm = 0;  // radius of those beside which the present ones lie
  double inner_mm = 0;   // largest radius of the instruments on the curves inside
  double own_mm = 0;     // same, on the curve of instrument k
  bool divided = false;  // the instruments so far lie beside each other
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    const bool has_room = k > 0 && clearance.has_room[k];
    if ((has_room || clearance.is_beside[k]) && !(clearance.stiffness_N_mm2 > 0)) {
      throw std::invalid_argument("the stiffness of the contact between curves must be above 0");
    }
    const double radius_mm = LargestRadius(instruments[k]);
    if (clearance.is_beside[k]) {
      if (divided) {
        throw std::invalid_argument("a stack has two instruments beside others; give one");
      }
      beside_mm = std::max(inner_mm, own_mm);
      inner_mm = 0;
      own_mm = radius_mm;
      divided = true;
      continue;
    }
    if (divided && !has_room && beside_mm > 0) {
      throw std::invalid_argument(
          "an instrument around instruments that lie beside each other needs room in its lumen");
    }
    if (has_room) {
      inner_mm = std::max(inner_mm, own_mm) + beside_mm;
      beside_mm = own_mm = 0;
      CheckEntries(instruments, clearance, k);
    }
    own_mm = std::max(own_mm, radius_mm);
    const double lumen_mm = clearance.lumen_radius_mm[k];
    if (inner_mm == 0 || lumen_mm > inner_mm) continue;
    throw std::invalid_argument("the instruments inside a lumen have a radius of " +
                                std::to_string(inner_mm) + " mm, and the lumen one of " +
                                std::to_string(lumen_mm) + " mm; it must be larger");
  }
}

void CheckCurves(const std::vector<WireModel>& instruments, const Clearance& clearance) {
  if (clearance.touches_itself && !(clearance.stiffness_N_mm2 > 0)) {
    throw std::invalid_argument(
        "the stiffness of the contact of a curve with itself must be above 0");
  }
  CheckRoom(instruments, clearance);
  const auto beyond = static_cast<std::ptrdiff_t>(instruments.size());
  const auto any_beyond = [beyond](const std::array<bool, kMostInstruments>& of) {
    return of[0] || std::any_of(of.begin() + beyond, of.end(), [](bool is) { return is; });
  };
  if (any_beyond(clearance.has_room)) {
    throw std::invalid_argument("there is no instrument in the lumen that is to have room");
  }
  if (any_beyond(clearance.is_beside)) {
    throw std::invalid_argument("there is no instrument beside which another one is to lie");
  }
}

}  // namespace

InstrumentStack::InstrumentStack(const WireModel& wire) : instruments_{&wire}, ranges_{{0, 1}} {}

InstrumentStack::InstrumentStack(std::vector<WireModel> instruments, const Clearance& clearance)
    : owned_(std::move(instruments)), clearance_(clearance) {
  CheckTogether(owned_, clearance);
  CheckCurves(owned_, clearance);
  for (const WireModel& model : owned_) instruments_.push_back(&model);
  if (size() == 1) {
    ranges_ = {{0, 1}};
    return;
  }
  for (int k = 0; k < size(); ++k) {
    if (k == 0 || clearance.has_room[k] || clearance.is_beside[k]) ranges_.push_back({k, k});
    ranges_.back().last = k + 1;
  }
  const CombinedRods rods(*this);
  for (int c = 0; c < curves(); ++c) empty_rods_.push_back(rods[c]);
}

InstrumentPoses InstrumentStack::Bounded(const InstrumentPoses& poses) const {
  InstrumentPoses bounded = poses;
  for (int k = 0; k < size(); ++k) {
    bounded[k].insertion_mm = std::clamp(poses[k].insertion_mm, 0.0, instrument(k).max_length_mm());
  }
  return bounded;
}

InstrumentPoses InstrumentStack::Towards(const InstrumentPoses& goal, const InstrumentPoses& here,
                                         double feed_mm, double turn_rad) const {
  double longest_mm = 0;
  double most_rad = 0;
  for (int k = 0; k < size(); ++k) {
    longest_mm = std::max(longest_mm, std::abs(goal[k].insertion_mm - here[k].insertion_mm));
    most_rad = std::max(most_rad, std::abs(goal[k].rotation_rad - here[k].rotation_rad));
  }
  const double feed_fraction = longest_mm > feed_mm ? feed_mm / longest_mm : 1;
  const double turn_fraction = most_rad > turn_rad ? turn_rad / most_rad : 1;
  double fraction = std::min(feed_fraction, turn_fraction);
  // Finds the instrument that passes the leader of its curve first, on this part of the way.
  int passed = -1;
  int passing = -1;
  for (int c = 0; c < curves(); ++c) {
    const int leader = Leader(c, here);
    for (int k = OnCurve(c).first; k < OnCurve(c).last; ++k) {
      const double lead_mm = here[leader].insertion_mm - here[k].insertion_mm;
      if (lead_mm == 0) continue;
      const double gain_mm = (goal[k].insertion_mm - here[k].insertion_mm) -
                             (goal[leader].insertion_mm - here[leader].insertion_mm);
      if (!(fraction * gain_mm > lead_mm)) continue;
      fraction = lead_mm / gain_mm;
      passed = leader;
      passing = k;
    }
  }
  if (fraction == 1) return goal;
  InstrumentPoses next = here;
  for (int k = 0; k < size(); ++k) {
    const double feed = goal[k].insertion_mm - here[k].insertion_mm;
    const double turn = goal[k].rotation_rad - here[k].rotation_rad;
    // The longest motion uses its exact limit, without rounding.
    const bool whole_feed = fraction == feed_fraction && std::abs(feed) == longest_mm;
    const bool whole_turn = fraction == turn_fraction && std::abs(turn) == most_rad;
    next[k].insertion_mm += whole_feed ? std::copysign(feed_mm, feed) : fraction * feed;
    next[k].rotation_rad += whole_turn ? std::copysign(turn_rad, turn) : fraction * turn;
  }
  if (passing >= 0) next[passing].insertion_mm = next[passed].insertion_mm;
  return next;
}

int InstrumentStack::CurveOf(int instrument) const {
  int curve = curves() - 1;
  while (OnCurve(curve).first > instrument) --curve;
  return curve;
}

int InstrumentStack::CurveAround(int curve) const {
  int around = curve + 1;
  while (around < curves() && LiesBeside(around)) ++around;
  return around;
}

bool InstrumentStack::AreBeside(int curve, int outer) const {
  while (curve < outer) curve = CurveAround(curve);
  return curve != outer;
}

int InstrumentStack::Leader(int curve, const InstrumentPoses& poses) const {
  const Range range = OnCurve(curve);
  int leader = range.first;
  for (int k = range.first + 1; k < range.last; ++k) {
    if (poses[k].insertion_mm > poses[leader].insertion_mm) leader = k;
  }
  return leader;
}

int InstrumentStack::SurfaceAt(int curve, const InstrumentPoses& poses, double arc_mm) const {
  const Range range = OnCurve(curve);
  int found = range.last - 1;
  for (int k = found - 1; k >= range.first && poses[found].insertion_mm < arc_mm; --k) {
    if (poses[k].insertion_mm > poses[found].insertion_mm) found = k;
  }
  return found;
}

int InstrumentStack::LumenAt(int curve, const InstrumentPoses& poses, double arc_mm) const {
  const Range range = OnCurve(curve);
  int found = range.first;
  for (int k = found + 1; k < range.last && poses[found].insertion_mm < arc_mm; ++k) {
    if (poses[k].insertion_mm > poses[found].insertion_mm) found = k;
  }
  return found;
}

namespace {

// Node before an arc length, and the distance beyond that node.
struct Stretch {
  int node;
  double beyond_mm;
};

Stretch Find(const WireModel& model, const Curve& curve, double insertion_mm) {
  const double s = std::clamp(insertion_mm, 0.0, curve.ArcLength(model));
  if (curve.segments() == 0 || s <= curve.first_segment_mm()) return {0, s};
  const double past = s - curve.first_segment_mm();
  const int k = std::min(static_cast<int>(past / model.segment_mm()), curve.segments() - 2);
  return {k + 1, past - k * model.segment_mm()};
}

}  // namespace

Eigen::Vector3d PointAt(const WireModel& model, const Curve& curve, double insertion_mm) {
  const Stretch at = Find(model, curve, insertion_mm);
  if (curve.segments() == 0) return curve.nodes().front();
  return curve.nodes()[at.node] + at.beyond_mm * curve.tangents()[at.node];
}

int NodesBefore(const WireModel& model, const Curve& curve, double insertion_mm) {
  const Stretch at = Find(model, curve, insertion_mm);
  return at.node + (at.beyond_mm > 0 ? 1 : 0);
}

void TakeNodes(const WireModel& model, const Curve& curve, double insertion_mm,
               std::vector<Eigen::Vector3d>& out) {
  const Stretch at = Find(model, curve, insertion_mm);
  out.assign(curve.nodes().begin(), curve.nodes().begin() + at.node + 1);
  if (at.beyond_mm > 0) out.push_back(PointAt(model, curve, insertion_mm));
}

}  // namespace torquer
