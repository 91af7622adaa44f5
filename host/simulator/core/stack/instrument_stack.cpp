#include "host/simulator/core/stack/instrument_stack.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace torquer {

using Eigen::Vector2d;

WireModel::Joint JointAt(const WireModel& model, double from_tip_mm) {
  const double at = std::max(0.0, from_tip_mm / model.segment_mm());
  const int k = static_cast<int>(at);
  const double t = at - k;
  const auto rest = [&model](int joint) -> Vector2d {
    const Eigen::Vector3d& r = model.rest_direction(joint);
    const double across = std::hypot(r[0], r[1]);
    if (across == 0) return Vector2d::Zero();
    return Vector2d(r[0], r[1]) * (std::atan2(across, r[2]) / across);
  };
  const auto mix = [t](const auto& a, const auto& b) { return a + t * (b - a); };
  const Vector2d a = rest(k);
  const Vector2d b = rest(k + 1);
  return {mix(model.rigidity_N_mm2(k), model.rigidity_N_mm2(k + 1)),
          mix(model.radius_mm(k), model.radius_mm(k + 1)), mix(a, b)};
}

namespace {

double TorsionalRigidityAt(const WireModel& model, double from_tip_mm) {
  const double at = std::max(0.0, from_tip_mm / model.segment_mm());
  const int k = static_cast<int>(at);
  const double a = model.torsional_rigidity_N_mm2(k);
  return a + (at - k) * (model.torsional_rigidity_N_mm2(k + 1) - a);
}

void CheckTogether(const std::vector<WireModel>& instruments) {
  if (instruments.empty() || instruments.size() > static_cast<std::size_t>(kMostInstruments)) {
    throw std::invalid_argument("a stack has " + std::to_string(instruments.size()) +
                                " instruments; give 1 to " + std::to_string(kMostInstruments));
  }
  if (instruments.size() == 1) return;
  const WireModel& first = instruments.front();
  for (const WireModel& model : instruments) {
    if (model.segment_mm() != first.segment_mm() || model.law() != first.law() ||
        model.sheath().point_mm != first.sheath().point_mm ||
        model.sheath().direction != first.sheath().direction) {
      throw std::invalid_argument("instruments of a stack need the same segments, law and sheath");
    }
    if (model.twists() != first.twists()) {
      throw std::invalid_argument("of instruments within each other all twist, or none");
    }
  }
}

void CheckRoom(const std::vector<WireModel>& instruments, const Clearance& clearance) {
  double inner_mm = 0;  // largest radius of the instruments on the curves inside
  double own_mm = 0;    // same, on the curve of instrument k
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    if (k > 0 && clearance.has_room[k]) {
      if (!(clearance.stiffness_N_mm2 > 0)) {
        throw std::invalid_argument("the lumen's stiffness must be above 0");
      }
      inner_mm = std::max(inner_mm, own_mm);
      own_mm = 0;
    }
    const WireModel& model = instruments[k];
    for (int j = 0; j <= model.max_segments(); ++j) own_mm = std::max(own_mm, model.radius_mm(j));
    const double lumen_mm = clearance.lumen_radius_mm[k];
    if (inner_mm == 0 || lumen_mm > inner_mm) continue;
    throw std::invalid_argument("an instrument inside a lumen has a radius of " +
                                std::to_string(inner_mm) + " mm, and the lumen one of " +
                                std::to_string(lumen_mm) + " mm; it must be smaller");
  }
  if (clearance.has_room[0] ||
      std::any_of(clearance.has_room.begin() + static_cast<std::ptrdiff_t>(instruments.size()),
                  clearance.has_room.end(), [](bool has) { return has; })) {
    throw std::invalid_argument("there is no instrument in the lumen that is to have room");
  }
}

// Rod with room for all instruments; Combine fills it.
std::unique_ptr<WireModel> EmptyRod(const std::vector<WireModel>& instruments) {
  const WireModel& first = instruments.front();
  double longest_mm = 0;
  for (const WireModel& model : instruments) {
    longest_mm = std::max(longest_mm, model.max_length_mm());
  }
  const WireSection section{.rigidity_N_mm2 = first.rigidity_N_mm2(0),
                            .radius_mm = first.radius_mm(0)};
  return std::make_unique<WireModel>(first.segment_mm(), std::vector<WireSection>{section}, 0,
                                     longest_mm, first.law(), first.sheath());
}

}  // namespace

InstrumentStack::InstrumentStack(const WireModel& wire)
    : instruments_{&wire}, rods_{&wire}, ranges_{{0, 1}} {}

InstrumentStack::InstrumentStack(std::vector<WireModel> instruments, const Clearance& clearance)
    : owned_(std::move(instruments)), clearance_(clearance) {
  CheckTogether(owned_);
  CheckRoom(owned_, clearance);
  for (const WireModel& model : owned_) instruments_.push_back(&model);
  if (size() == 1) {
    rods_ = {instruments_.front()};
    ranges_ = {{0, 1}};
    return;
  }
  for (int k = 0; k < size(); ++k) {
    if (k == 0 || clearance.has_room[static_cast<std::size_t>(k)]) ranges_.push_back({k, k});
    ranges_.back().last = k + 1;
  }
  for (int c = 0; c < curves(); ++c) {
    combined_.push_back(EmptyRod(owned_));
    rods_.push_back(combined_.back().get());
  }
  joints_.resize(static_cast<std::size_t>(rod().max_segments()) + 1);
  if (instrument(0).twists()) twisting_.resize(joints_.size());
  Combine(InstrumentPlaces(size()));
}

InstrumentPlaces InstrumentStack::Bounded(const InstrumentPlaces& places) const {
  InstrumentPlaces bounded = places;
  for (int k = 0; k < size(); ++k) {
    bounded[k].insertion_mm =
        std::clamp(places[k].insertion_mm, 0.0, instrument(k).max_length_mm());
  }
  return bounded;
}

InstrumentPlaces InstrumentStack::Towards(const InstrumentPlaces& goal,
                                          const InstrumentPlaces& here, double feed_mm,
                                          double turn_rad) const {
  double longest_mm = 0;
  double most_rad = 0;
  for (int k = 0; k < size(); ++k) {
    longest_mm = std::max(longest_mm, std::abs(goal[k].insertion_mm - here[k].insertion_mm));
    most_rad = std::max(most_rad, std::abs(goal[k].rotation_rad - here[k].rotation_rad));
  }
  const double feed_part = longest_mm > feed_mm ? feed_mm / longest_mm : 1;
  const double turn_part = most_rad > turn_rad ? turn_rad / most_rad : 1;
  double part = std::min(feed_part, turn_part);
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
      if (!(part * gain_mm > lead_mm)) continue;
      part = lead_mm / gain_mm;
      passed = leader;
      passing = k;
    }
  }
  if (part == 1) return goal;
  InstrumentPlaces next = here;
  for (int k = 0; k < size(); ++k) {
    const double feed = goal[k].insertion_mm - here[k].insertion_mm;
    const double turn = goal[k].rotation_rad - here[k].rotation_rad;
    // The longest motion uses its exact limit, without rounding.
    const bool whole_feed = part == feed_part && std::abs(feed) == longest_mm;
    const bool whole_turn = part == turn_part && std::abs(turn) == most_rad;
    next[k].insertion_mm += whole_feed ? std::copysign(feed_mm, feed) : part * feed;
    next[k].rotation_rad += whole_turn ? std::copysign(turn_rad, turn) : part * turn;
  }
  if (passing >= 0) next[passing].insertion_mm = next[passed].insertion_mm;
  return next;
}

int InstrumentStack::CurveOf(int instrument) const {
  int curve = curves() - 1;
  while (OnCurve(curve).first > instrument) --curve;
  return curve;
}

int InstrumentStack::Leader(int curve, const InstrumentPlaces& places) const {
  const Range range = OnCurve(curve);
  int leader = range.first;
  for (int k = range.first + 1; k < range.last; ++k) {
    if (places[k].insertion_mm > places[leader].insertion_mm) leader = k;
  }
  return leader;
}

int InstrumentStack::SurfaceAt(int curve, const InstrumentPlaces& places, double arc_mm) const {
  const Range range = OnCurve(curve);
  int found = range.last - 1;
  for (int k = found - 1; k >= range.first && places[found].insertion_mm < arc_mm; --k) {
    if (places[k].insertion_mm > places[found].insertion_mm) found = k;
  }
  return found;
}

int InstrumentStack::LumenAt(int curve, const InstrumentPlaces& places, double arc_mm) const {
  const Range range = OnCurve(curve);
  int found = range.first;
  for (int k = found + 1; k < range.last && places[found].insertion_mm < arc_mm; ++k) {
    if (places[k].insertion_mm > places[found].insertion_mm) found = k;
  }
  return found;
}

// Collects the instruments of a curve in a rod that ends at `end_mm`, in order of decreasing reach;
// of equals, the innermost comes first. Returns their number.
int InstrumentStack::Gather(const InstrumentPlaces& places, Range range, double end_mm,
                            Members& members) const {
  const auto [first, last] = range;
  for (int k = first; k < last; ++k) {
    Member& member = members[static_cast<std::size_t>(k - first)];
    const double rotation = places[k].rotation_rad;
    member.model = &instrument(k);
    member.instrument = static_cast<std::size_t>(k);
    member.behind_mm = end_mm - places[k].insertion_mm;
    member.turn << std::cos(rotation), std::sin(rotation);
  }
  const int count = last - first;
  for (int k = 1; k < count; ++k) {
    for (auto m = static_cast<std::size_t>(k);
         m > 0 && members[m].behind_mm < members[m - 1].behind_mm; --m) {
      std::swap(members[m], members[m - 1]);
    }
  }
  return count;
}

void InstrumentStack::Combine(const InstrumentPlaces& places) {
  Members members;
  for (std::size_t c = 0; c < combined_.size(); ++c) {
    const int curve = static_cast<int>(c);
    const int count = Gather(places, OnCurve(curve), Reach(curve, places), members);
    CombineRod(members, OnCurve(curve).first, count, *combined_[c]);
  }
}

void InstrumentStack::CombineRod(const Members& members, int first, int count, WireModel& rod) {
  const int tip_segments = members[0].model->tip_segments();
  CombineJoints(members, count, rod);
  if (twisting_.empty()) {
    rod.ReplaceJoints(joints_, tip_segments);
    return;
  }
  CombineTwists(members, count, rod.segment_mm());
  rod.ReplaceJoints(joints_, twisting_, first, count, tip_segments);
}

void InstrumentStack::CombineJoints(const Members& members, int count, const WireModel& rod) {
  const double lambda = rod.segment_mm();
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const double from_tip = static_cast<double>(k) * lambda;
    WireModel::Joint& joint = joints_[k];
    joint = JointAt(*members[0].model, from_tip - members[0].behind_mm);
    joint.rest_rad = Turned(joint.rest_rad, members[0].turn);
    // The joint stands for half a segment of wire to either side. At each place of it, the EI of
    // all instruments that reach the place add up. The pieces along the joint are in series: their
    // compliances and angles add up.
    double sum_EI = joint.rigidity_N_mm2;
    Vector2d sum_EI_rest = joint.rigidity_N_mm2 * joint.rest_rad;
    double covered = 1;
    double compliance = 0;
    Vector2d rest = Vector2d::Zero();
    for (int m = 1; m < count; ++m) {
      const Member& other = members[static_cast<std::size_t>(m)];
      const double beyond = (from_tip - other.behind_mm) / lambda;
      const double part = std::clamp(beyond + 0.5, 0.0, 1.0);
      if (part == 0) break;
      WireModel::Joint added = JointAt(*other.model, from_tip - other.behind_mm);
      added.rest_rad = Turned(added.rest_rad, other.turn);
      compliance += (covered - part) / sum_EI;
      rest += (covered - part) * (sum_EI_rest / sum_EI);
      covered = part;
      sum_EI += added.rigidity_N_mm2;
      sum_EI_rest += added.rigidity_N_mm2 * added.rest_rad;
      // The radius is that of the segment distal of the joint.
      joint.radius_mm +=
          std::clamp(beyond, 0.0, 1.0) * std::max(0.0, added.radius_mm - joint.radius_mm);
    }
    joint.rest_rad = rest + covered * (sum_EI_rest / sum_EI);
    joint.rigidity_N_mm2 = 1 / (compliance + covered / sum_EI);
  }
}

void InstrumentStack::CombineTwists(const Members& members, int count, double lambda) {
  for (std::size_t k = 0; k < twisting_.size(); ++k) {
    const double from_tip = static_cast<double>(k) * lambda;
    WireModel::TwistingJoint& joint = twisting_[k];
    joint = WireModel::TwistingJoint();
    std::array<double, kMostInstruments + 1> part =
        {};  // entry m: fraction of the joint that member m covers
    std::array<double, kMostInstruments> rigidity = {};
    for (int m = 0; m < count; ++m) {
      const auto at = static_cast<std::size_t>(m);
      const Member& member = members[at];
      const double own_mm = from_tip - member.behind_mm;
      const WireModel::Joint own = JointAt(*member.model, own_mm);
      part[at] = m == 0 ? 1 : std::clamp(own_mm / lambda + 0.5, 0.0, 1.0);
      rigidity[at] = own.rigidity_N_mm2;
      joint.of[member.instrument].rest_rad = own.rest_rad;
      joint.of[member.instrument].torsional_rigidity_N_mm2 =
          TorsionalRigidityAt(*member.model, own_mm);
    }
    double sum_EI = 0;
    for (std::size_t p = 0; p < static_cast<std::size_t>(count); ++p) {
      sum_EI += rigidity[p];
      const double piece = part[p] - part[p + 1];
      if (piece == 0) continue;
      for (std::size_t a = 0; a <= p; ++a) {
        joint.of[members[a].instrument].weight += piece * rigidity[a] / sum_EI;
        for (std::size_t b = 0; b < a; ++b) {
          const auto [first, second] = std::minmax(members[a].instrument, members[b].instrument);
          joint.mutual_N_mm2[first][second] += piece * rigidity[a] * rigidity[b] / sum_EI;
        }
      }
    }
  }
}

namespace {

// Node before an arc length, and the distance beyond that node.
struct Stretch {
  int node;
  double beyond_mm;
};

Stretch Find(const WireModel& rod, const Curve& curve, double insertion_mm) {
  const double s = std::clamp(insertion_mm, 0.0, curve.ArcLength(rod));
  if (curve.segments() == 0 || s <= curve.first_segment_mm()) return {0, s};
  const double past = s - curve.first_segment_mm();
  const int k = std::min(static_cast<int>(past / rod.segment_mm()), curve.segments() - 2);
  return {k + 1, past - k * rod.segment_mm()};
}

}  // namespace

Eigen::Vector3d PointAt(const WireModel& rod, const Curve& curve, double insertion_mm) {
  const Stretch at = Find(rod, curve, insertion_mm);
  if (curve.segments() == 0) return curve.nodes().front();
  return curve.nodes()[at.node] + at.beyond_mm * curve.tangents()[at.node];
}

void TakePart(const WireModel& rod, const Curve& curve, double insertion_mm,
              std::vector<Eigen::Vector3d>& out) {
  const Stretch at = Find(rod, curve, insertion_mm);
  out.assign(curve.nodes().begin(), curve.nodes().begin() + at.node + 1);
  if (at.beyond_mm > 0) out.push_back(PointAt(rod, curve, insertion_mm));
}

}  // namespace torquer
