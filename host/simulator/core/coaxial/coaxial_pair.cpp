#include "host/simulator/core/coaxial/coaxial_pair.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace torquer {

using Eigen::Vector2d;

namespace {

// What an instrument is at a distance from its tip: between its joints.
WireModel::Joint At(const WireModel& model, double from_tip_mm) {
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

Vector2d Turned(const Vector2d& v, double angle_rad) {
  const double c = std::cos(angle_rad);
  const double s = std::sin(angle_rad);
  return {c * v[0] - s * v[1], s * v[0] + c * v[1]};
}

WireModel Rod(const WireModel& wire, const WireModel& catheter) {
  if (wire.segment_mm() != catheter.segment_mm() || wire.law() != catheter.law() ||
      wire.sheath().point_mm != catheter.sheath().point_mm ||
      wire.sheath().direction != catheter.sheath().direction) {
    throw std::invalid_argument("wire and catheter need the same segments, law and sheath");
  }
  if (wire.twists() || catheter.twists()) {
    throw std::invalid_argument("a wire in a catheter cannot twist here");
  }
  const WireSection section{.rigidity_N_mm2 = wire.rigidity_N_mm2(0),
                            .radius_mm = wire.radius_mm(0)};
  return WireModel(wire.segment_mm(), {section}, 0,
                   std::max(wire.max_length_mm(), catheter.max_length_mm()), wire.law(),
                   wire.sheath());
}

}  // namespace

CoaxialPair::CoaxialPair(WireModel wire, WireModel catheter)
    : wire_(std::move(wire)),
      catheter_(std::move(catheter)),
      rod_(Rod(wire_, catheter_)),
      joints_(static_cast<std::size_t>(rod_.max_segments()) + 1) {
  Place({}, {});
}

double CoaxialPair::reach_mm() const {
  return std::max(wire_place_.insertion_mm, catheter_place_.insertion_mm);
}

void CoaxialPair::Place(const InstrumentPlace& wire, const InstrumentPlace& catheter) {
  wire_place_ = wire;
  catheter_place_ = catheter;
  const double lambda = rod_.segment_mm();
  const bool wire_leads = wire.insertion_mm >= catheter.insertion_mm;
  const WireModel& first = wire_leads ? wire_ : catheter_;
  const WireModel& second = wire_leads ? catheter_ : wire_;
  // How far the tip of the second is behind.
  const double behind = std::abs(wire.insertion_mm - catheter.insertion_mm);
  const double turn = catheter.rotation_rad - wire.rotation_rad;

  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const double from_tip = static_cast<double>(k) * lambda;
    WireModel::Joint& joint = joints_[k];
    joint = At(first, from_tip);
    if (!wire_leads) joint.rest_rad = Turned(joint.rest_rad, turn);
    // The joint stands for the wire half a segment to either side, the radius for the segment
    // distal of it.
    const double part = std::clamp((from_tip - behind) / lambda + 0.5, 0.0, 1.0);
    const double covered = std::clamp((from_tip - behind) / lambda, 0.0, 1.0);
    if (part == 0 && covered == 0) continue;
    WireModel::Joint other = At(second, from_tip - behind);
    if (wire_leads) other.rest_rad = Turned(other.rest_rad, turn);
    joint.radius_mm += covered * std::max(0.0, other.radius_mm - joint.radius_mm);
    const double sum = joint.rigidity_N_mm2 + other.rigidity_N_mm2;
    const Vector2d both =
        (joint.rigidity_N_mm2 * joint.rest_rad + other.rigidity_N_mm2 * other.rest_rad) / sum;
    // One after the other: compliances and angles add up.
    joint.rest_rad += part * (both - joint.rest_rad);
    joint.rigidity_N_mm2 = 1 / (part / sum + (1 - part) / joint.rigidity_N_mm2);
  }
  rod_.ReplaceJoints(joints_, first.tip_segments());
}

namespace {

// The node before an arc length, and how far beyond it that is.
struct Stretch {
  int node;
  double beyond_mm;
};

Stretch Find(const WireModel& rod, const WireState& state, double insertion_mm) {
  const double s = std::clamp(insertion_mm, 0.0, state.ArcLength(rod));
  if (state.segments() == 0 || s <= state.first_segment_mm) return {0, s};
  const double past = s - state.first_segment_mm;
  const int k = std::min(static_cast<int>(past / rod.segment_mm()), state.segments() - 2);
  return {k + 1, past - k * rod.segment_mm()};
}

}  // namespace

Eigen::Vector3d PointAt(const WireModel& rod, const WireState& state, double insertion_mm) {
  const Stretch at = Find(rod, state, insertion_mm);
  if (state.segments() == 0) return state.nodes.front();
  return state.nodes[at.node] + at.beyond_mm * state.tangents[at.node];
}

void TakePart(const WireModel& rod, const WireState& state, double insertion_mm,
              std::vector<Eigen::Vector3d>& out) {
  const Stretch at = Find(rod, state, insertion_mm);
  out.assign(state.nodes.begin(), state.nodes.begin() + at.node + 1);
  if (at.beyond_mm > 0) out.push_back(PointAt(rod, state, insertion_mm));
}

}  // namespace torquer
