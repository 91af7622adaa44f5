#include "host/simulator/core/stack/combined_rods.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/simulator/core/wire_sections.h"

namespace torquer {

using Eigen::Vector2d;

namespace {

// Rod with room for all instruments of a stack, in the sheath of instrument `of`.
WireModel EmptyRod(const InstrumentStack& stack, int of) {
  const WireModel& first = stack.instrument(of);
  double longest_mm = 0;
  for (int k = 0; k < stack.size(); ++k) {
    longest_mm = std::max(longest_mm, stack.instrument(k).max_length_mm());
  }
  const WireSection section{.rigidity_N_mm2 = first.rigidity_N_mm2(0),
                            .radius_mm = first.radius_mm(0)};
  return {first.segment_mm(), {section}, 0, longest_mm, first.law(), first.sheath()};
}

}  // namespace

CombinedRods::CombinedRods(const InstrumentStack& stack) : stack_(stack) {
  if (stack.size() == 1) return;
  for (int c = 0; c < stack.curves(); ++c) {
    combined_.push_back(EmptyRod(stack, stack.OnCurve(c).first));
  }
  members_.resize(combined_.size());
  most_joints_ = static_cast<std::size_t>(combined_.front().max_segments()) + 1;
  joints_.resize(most_joints_);
  if (stack.instrument(0).twists()) twisting_.resize(most_joints_);
  const InstrumentPoses outside(stack.size());
  for (int c = 0; c < stack.curves(); ++c) {
    // Makes room for all joints.
    Members members = Gather(outside, c);
    members.joints = most_joints_;
    CombineRod(members, stack.OnCurve(c).first, combined_[c]);
  }
  Combine(outside);
}

// Collects the instruments of a curve in order of decreasing reach. With equal reach, the innermost
// comes first.
CombinedRods::Members CombinedRods::Gather(const InstrumentPoses& poses, int curve) const {
  const auto [first, last] = stack_.OnCurve(curve);
  const double reach_mm = stack_.Reach(curve, poses);
  const double segment_mm = stack_.instrument(first).segment_mm();
  // A retraction starts with the joints of the longer wire. Instruments that move as one keep their
  // rod until they need another block of joints.
  constexpr std::size_t kBlock = 64;
  const auto needed = static_cast<std::size_t>(reach_mm / segment_mm) + 3;
  Members members;
  members.joints = std::min(most_joints_, (needed / kBlock + 1) * kBlock);
  members.count = last - first;
  for (int k = first; k < last; ++k) {
    Member& member = members.of[k - first];
    const double rotation = poses[k].rotation_rad;
    member.model = &stack_.instrument(k);
    member.instrument = static_cast<std::size_t>(k);
    member.behind_mm = reach_mm - poses[k].insertion_mm;
    member.near_mm = std::min(poses[k].insertion_mm, 2 * segment_mm);
    member.turn << std::cos(rotation), std::sin(rotation);
  }
  for (int k = 1; k < members.count; ++k) {
    for (auto m = static_cast<std::size_t>(k);
         m > 0 && members.of[m].behind_mm < members.of[m - 1].behind_mm; --m) {
      std::swap(members.of[m], members.of[m - 1]);
    }
  }
  return members;
}

void CombinedRods::Combine(const InstrumentPoses& poses) {
  for (std::size_t c = 0; c < combined_.size(); ++c) {
    const int curve = static_cast<int>(c);
    const Members members = Gather(poses, curve);
    // Instruments that move as one keep their rod.
    if (members == members_[c]) continue;
    members_[c] = members;
    CombineRod(members, stack_.OnCurve(curve).first, combined_[c]);
  }
}

namespace {

// Part of a segment that an instrument covers, if the segment's distal end is `beyond_mm` from the
// instrument's tip. The first segment may be half as long as the others. So the part also falls to
// 0 as the tip reaches the sheath.
double CoveredPart(double beyond_mm, double inserted_mm, double segment_mm) {
  const double covered = std::clamp(1 + beyond_mm / segment_mm, 0.0, 1.0);
  return covered * std::min(2 * inserted_mm / segment_mm, 1.0);
}

}  // namespace

void CombinedRods::CombineRod(const Members& members, int first, WireModel& rod) {
  const double lambda = rod.segment_mm();
  std::array<RodJoints::Member, kMostInstruments> placed;
  for (int m = 0; m < members.count; ++m) {
    placed[m] = {&members.of[m].model->sections(), members.of[m].behind_mm,
                 EndInSheath(members.of[m].behind_mm, members.of[m].near_mm, lambda)};
  }
  RodJoints integrals(placed, members.count, lambda);
  joints_.resize(members.joints);
  if (!twisting_.empty()) twisting_.resize(members.joints);
  for (std::size_t k = 0; k < joints_.size(); ++k) {
    const int from_tip = static_cast<int>(k);
    const double from_tip_mm = from_tip * lambda;
    const JointIntegrals& integral = integrals.At(from_tip);
    WireModel::Joint& joint = joints_[k];
    joint.rigidity_N_mm2 = integral.rigidity_N_mm2;
    joint.rest_rad.setZero();
    joint.radius_mm = members.of[0].model->radius_mm(from_tip);
    for (int m = 0; m < members.count; ++m) {
      const Member& member = members.of[m];
      joint.rest_rad += Turned(integral.bend_rad[m], member.turn);
      if (m == 0) continue;
      // The radius is that of the segment proximal of the joint, at its distal end. A segment that
      // an instrument covers in part has a mean radius.
      const double beyond_mm = from_tip_mm - member.behind_mm;
      const double covered = CoveredPart(beyond_mm, member.near_mm, lambda);
      if (covered == 0) continue;
      const double added_mm = SectionAt(member.model->sections(), beyond_mm).radius_mm;
      joint.radius_mm += covered * std::max(0.0, added_mm - joint.radius_mm);
    }
    if (twisting_.empty()) {
      joint.mutual_mJ = MutualOf(members, integral);
    } else {
      CombineTwists(members, integral, from_tip_mm, twisting_[k]);
    }
  }
  const int tip_segments = members.of[0].model->tip_segments();
  if (twisting_.empty()) {
    rod.ReplaceJoints(joints_, tip_segments);
  } else {
    rod.ReplaceJoints(joints_, twisting_, first, members.count, tip_segments);
  }
}

// Adds (38) over the pairs, each turned by its hands.
double CombinedRods::MutualOf(const Members& members, const JointIntegrals& integrals) {
  double energy_mJ = 0;
  for (int b = 0; b < members.count; ++b) {
    for (int a = 0; a < b; ++a) {
      const JointIntegrals::Pair& pair = integrals.pairs[a][b];
      if (pair.constant_mJ == 0) continue;  // both are straight
      const Eigen::Vector2d& of_a = members.of[a].turn;
      const Eigen::Vector2d& of_b = members.of[b].turn;
      const double sine = of_a[0] * of_b[1] - of_a[1] * of_b[0];
      energy_mJ += pair.constant_mJ - pair.along_mJ * of_a.dot(of_b) - pair.across_mJ * sine;
    }
  }
  return energy_mJ;
}

double CombinedRods::MutualEnergyMJ(int number, const Curve& curve) const {
  if (combined_.empty()) return 0;
  const WireModel& model = combined_[number];
  double energy_mJ = 0;
  for (int i = 0; i < curve.segments(); ++i) {
    const double fraction = JointLength(model, curve, i) / model.segment_mm();
    energy_mJ += fraction * model.mutual_mJ(curve.segments() - i);
  }
  return energy_mJ;
}

void CombinedRods::CombineTwists(const Members& members, const JointIntegrals& integrals,
                                 double from_tip_mm, WireModel::TwistingJoint& joint) {
  joint = WireModel::TwistingJoint();
  for (int b = 0; b < members.count; ++b) {
    const Member& member = members.of[b];
    WireModel::TwistingJoint::Contribution& from = joint.of[member.instrument];
    from.bend_rad = integrals.bend_rad[b];
    from.torsional_rigidity_N_mm2 = JointTorsionalRigidity(
        member.model->sections(), from_tip_mm - member.behind_mm, member.model->segment_mm());
    for (int a = 0; a < b; ++a) {
      const JointIntegrals::Pair& pair = integrals.pairs[a][b];
      const auto [first, second] = std::minmax(members.of[a].instrument, member.instrument);
      const double across_mJ = first == member.instrument ? -pair.across_mJ : pair.across_mJ;
      joint.mutual[first][second] = {pair.constant_mJ, pair.along_mJ, across_mJ};
    }
  }
}

}  // namespace torquer
