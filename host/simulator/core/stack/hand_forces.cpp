#include "host/simulator/core/stack/hand_forces.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/stack/stack_terms.h"

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Arc length of a node past the sheath.
double NodeArcMm(const WireModel& rod, const Curve& curve, int node) {
  return node == 0 ? 0 : curve.first_segment_mm() + (node - 1) * rod.segment_mm();
}

const Vector3d& TangentBefore(const WireModel& rod, const Curve& curve, int joint) {
  return joint == 0 ? rod.sheath().direction : curve.tangents()[joint - 1];
}

// Part of the push that a straight sheath takes if it holds an instrument only against turning. It
// is the energy of the twist per length, (34).
double TorsionalThrust(const WireModel& rod, const Curve& curve, int instrument) {
  if (rod.spins() == 0) return 0;
  const double twist_rad = curve.TwistOf(0, instrument);
  return TwistStiffnessOf(rod, curve, 0, instrument) * twist_rad * twist_rad /
         (2 * JointLength(rod, curve, 0));
}

// Bend of a joint, as a rotation vector.
Vector3d Bend(const Vector3d& before, const Vector3d& after) {
  const Vector3d axis = before.cross(after);
  const double sine = axis.norm();
  return sine > 0 ? Vector3d(std::atan2(sine, before.dot(after)) / sine * axis) : axis;
}

// Vector across the tangent before a joint, with components towards the normals of an instrument's
// tip. As a rotation vector: bending towards the first normal turns about the second.
Vector3d FromOwnNormals(const WireModel& rod, const Curve& curve, int joint, int instrument,
                        const Vector2d& own) {
  if (own.isZero(0)) return Vector3d::Zero();
  const Vector3d& tangent = TangentBefore(rod, curve, joint);
  const Vector3d& first = joint == 0 ? rod.sheath_normal() : curve.normals()[joint - 1];
  const bool twists = rod.spins() > 0;
  const double turn_rad =
      twists ? curve.TurnBefore(joint, instrument) : curve.poses()[instrument].rotation_rad;
  Vector2d turned = Turned(own, Vector2d(std::cos(turn_rad), std::sin(turn_rad)));
  if (!twists) {
    turned = Turned(turned, curve.reference_twist()[curve.segments() - joint]);
  }
  return tangent.cross(turned[0] * first + turned[1] * tangent.cross(first));
}

}  // namespace

HandForces::OnCurve HandForces::CurveOf(const CombinedRods& rods, const WireState& state,
                                        const QuadraticModel& quadratic, int number,
                                        const CurveLoads& loads) {
  return {.rod = rods[number],
          .curve = state.curve(number),
          .at = quadratic.curve(number),
          .number = number,
          .range = rods.stack().OnCurve(number),
          .loads = loads};
}

// Shares the loads between nodes by the lever rule, like the contacts. An instrument that touches
// the wall or the lumen takes the loads there. The outermost on a curve takes all others.
void HandForces::DistributeLoads(const InstrumentStack& stack, const OnCurve& on) {
  const auto nodes = static_cast<std::size_t>(on.curve.segments()) + 1;
  for (int k = on.range.first; k < on.range.last; ++k) {
    load_N_[k].assign(nodes, Vector3d::Zero());
  }
  const auto add = [&](int instrument, int segment, double fraction, const Vector3d& load_N) {
    std::vector<Vector3d>& loads_N = load_N_[instrument];
    loads_N[segment] += (1 - fraction) * load_N;
    loads_N[segment + 1] += fraction * load_N;
  };
  const PointSet& points = on.at.points;
  for (int q = 0; q < points.size(); ++q) {
    const double fraction = static_cast<double>(q % points.per_segment + 1) / points.per_segment;
    add(points.SurfaceAt(q), q / points.per_segment, fraction, -on.loads.point_gradient_N[q]);
  }
  const InstrumentPoses& poses = on.curve.poses();
  for (const LumenLoad& load : on.loads.in_lumen) {
    const double arc_mm = NodeArcMm(on.rod, on.curve, load.segment) + load.past_mm;
    const int instrument = load.in_own_lumen ? stack.LumenAt(on.number, poses, arc_mm)
                                             : stack.SurfaceAt(on.number, poses, arc_mm);
    add(instrument, load.segment, load.past_mm / on.curve.SegmentLength(on.rod, load.segment),
        load.force_N - load.unfelt_N * on.curve.tangents()[load.segment]);
  }
}

// Finds the moment of each instrument at a joint, as the mean over the joint's hat. The moment M of
// all instruments is constant there. At each place it bends them to the common curvature
// (M + sum(EI kappa)) / sum(EI).
void HandForces::FindMoments(const JointIntegrals& integrals, const OnCurve& on, int joint) {
  const WireModel& rod = on.rod;
  const Curve& curve = on.curve;
  const double length_mm = JointLength(rod, curve, joint);
  const double fraction = length_mm / rod.segment_mm();
  const Vector3d& before = TangentBefore(rod, curve, joint);
  std::array<Vector3d, kMostInstruments> rest_rad;
  Vector3d bend_rad = Bend(before, curve.tangents()[joint]);
  for (int m = 0; m < count_; ++m) {
    rest_rad[m] = fraction * FromOwnNormals(rod, curve, joint, order_[m], integrals.bend_rad[m]);
    bend_rad -= rest_rad[m];
  }
  const Vector3d moment_mJ = integrals.rigidity_N_mm2 / length_mm * bend_rad;
  for (int m = 0; m < count_; ++m) {
    const int k = order_[m];
    section_forces_[k].moment_before_mJ = integrals.share[m] * moment_mJ;
    section_forces_[k].inside =
        curve.poses()[order_[m]].insertion_mm >= NodeArcMm(rod, curve, joint + 1);
    hands_[k].torque_mJ -= before.dot(rest_rad[m].cross(moment_mJ));
  }
  FindPairMoments(integrals, on, joint);
}

// Adds the moments and torques with which instruments of different rest shape bend each other.
void HandForces::FindPairMoments(const JointIntegrals& integrals, const OnCurve& on, int joint) {
  const WireModel& rod = on.rod;
  const Curve& curve = on.curve;
  const double lambda = rod.segment_mm();
  const double fraction = JointLength(rod, curve, joint) / lambda;
  const Vector3d& before = TangentBefore(rod, curve, joint);
  for (int b = 0; b < count_; ++b) {
    for (int a = 0; a < b; ++a) {
      const JointIntegrals::Pair& pair = integrals.pairs[a][b];
      if (pair.constant_mJ == 0) continue;  // both are straight
      const Vector3d of_a = FromOwnNormals(rod, curve, joint, order_[a], pair.of_a_mJ_mm);
      const Vector3d of_b = FromOwnNormals(rod, curve, joint, order_[b], pair.of_b_mJ_mm);
      const int first = order_[a];
      const auto second = static_cast<std::size_t>(order_[b]);
      section_forces_[first].moment_before_mJ += (of_b - of_a) / lambda;
      section_forces_[second].moment_before_mJ += (of_a - of_b) / lambda;
      // Turn from the normals of a to those of b.
      const Vector3d axis_a = FromOwnNormals(rod, curve, joint, order_[a], Vector2d::UnitX());
      const Vector3d axis_b = FromOwnNormals(rod, curve, joint, order_[b], Vector2d::UnitX());
      const double cosine = axis_a.dot(axis_b);
      const double sine = before.dot(axis_a.cross(axis_b));
      const double torque_mJ = fraction * (pair.along_mJ * sine - pair.across_mJ * cosine);
      hands_[first].torque_mJ -= torque_mJ;
      hands_[second].torque_mJ += torque_mJ;
    }
  }
}

// Balances each instrument at a node: finds its force in the segment before the node.
void HandForces::Balance(const OnCurve& on, int node, const Sliding& sliding) {
  const Curve& curve = on.curve;
  constexpr int kRounds = 3;  // friction depends on the tension, which it changes
  const Vector3d& before = curve.tangents()[node - 1];
  const Vector3d& beyond =
      node < curve.segments() ? curve.tangents()[node] : curve.tangents()[node - 1];
  const Vector3d tangent = (before + beyond).normalized();
  const double length_mm = (curve.nodes()[node] - curve.nodes()[node - 1]).norm();
  for (SectionForces& section : section_forces_) section.friction_N = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (int k = on.range.first; k < on.range.last; ++k) {
      SectionForces& section = section_forces_[k];
      const Vector3d shear_N =
          before.cross(section.moment_mJ - section.moment_before_mJ) / length_mm;
      const double axial_N =
          section.force_N.dot(tangent) + section.friction_N + load_N_[k][node].dot(tangent);
      section.force_before_N =
          (axial_N - shear_N.dot(tangent)) / before.dot(tangent) * before + shear_N;
    }
    if (sliding.coefficient == 0) break;
    FindFriction(on, node, sliding);
  }
}

// Friction between instruments. Each instrument presses against the next one around it, by its
// tension and the tensions of all instruments within. The contribution of their bending moments is
// left out. At a step of rest shape or rigidity it is a couple. Its forces grow as the clearance
// shrinks.
void HandForces::FindFriction(const OnCurve& on, int node, const Sliding& sliding) {
  const Curve& curve = on.curve;
  const Vector3d& before = curve.tangents()[node - 1];
  const Vector3d& beyond =
      node < curve.segments() ? curve.tangents()[node] : curve.tangents()[node - 1];
  const Vector3d tangent = (before + beyond).normalized();
  for (SectionForces& section : section_forces_) section.friction_N = 0;
  Vector3d held_N = Vector3d::Zero();
  int inner = -1;
  for (int k = on.range.first; k < on.range.last; ++k) {
    SectionForces& section = section_forces_[k];
    if (!section.inside) continue;
    if (inner >= 0) {
      const double pressed_N = held_N.norm();
      const double most_N = sliding.coefficient * pressed_N;
      pressed_N_[node][inner] = pressed_N;
      const int way = sliding.direction[inner][k];
      section_forces_[inner].friction_N -= way * most_N;
      section.friction_N += way * most_N;
    }
    const Vector3d on_N = section.force_before_N.dot(before) * before -
                          section.force_N.dot(beyond) * beyond - load_N_[k][node];
    held_N += on_N - on_N.dot(tangent) * tangent;
    inner = k;
  }
}

void HandForces::Reserve(int segments, int points_per_segment) {
  const auto nodes = static_cast<std::size_t>(segments) + 1;
  for (std::vector<Vector3d>& load_N : load_N_) load_N.reserve(nodes);
  pressed_N_.reserve(nodes);
  const std::size_t points = nodes * static_cast<std::size_t>(points_per_segment);
  // Room for the places of a curve in a lumen, and in its own.
  const std::size_t places =
      4 * nodes * static_cast<std::size_t>(LumenPairs::PiecesPerSegment(points_per_segment));
  loads_.Reserve(points, places);
}

// Balances all instruments of a curve, from the tip to the sheath.
void HandForces::BalanceAll(const InstrumentStack& stack, const OnCurve& on,
                            const Sliding& sliding) {
  const Curve& curve = on.curve;
  count_ = 0;
  for (int k = on.range.first; k < on.range.last; ++k) {
    order_[count_++] = k;
  }
  std::sort(order_.begin(), order_.begin() + count_, [&curve](int a, int b) {
    return curve.poses()[a].insertion_mm > curve.poses()[b].insertion_mm;
  });
  DistributeLoads(stack, on);
  std::array<RodJoints::Member, kMostInstruments> members;
  for (int m = 0; m < count_; ++m) {
    const int k = order_[m];
    const double inserted_mm = curve.poses()[k].insertion_mm;
    const double behind_mm = curve.insertion_mm() - inserted_mm;
    members[m] = {&stack.instrument(k).sections(), behind_mm,
                  EndInSheath(behind_mm, inserted_mm, on.rod.segment_mm())};
  }
  RodJoints joints(members, count_, on.rod.segment_mm());
  for (int i = curve.segments(); i > 0; --i) {
    for (SectionForces& section : section_forces_) {
      section.moment_mJ = section.moment_before_mJ;
      section.force_N = section.force_before_N;
    }
    // The torque of an instrument that twists reaches its hand as its own torsion. The hand itself
    // turns the rest shape at the clamp.
    if (i == 1 && on.rod.spins() > 0) {
      for (int k = on.range.first; k < on.range.last; ++k) {
        hands_[k].torque_mJ = -TwistStiffnessOf(on.rod, curve, 0, k) * curve.TwistOf(0, k);
      }
    }
    FindMoments(joints.At(curve.segments() - (i - 1)), on, i - 1);
    Balance(on, i, sliding);
  }
}

void HandForces::FindPressed(const CombinedRods& rods, const WireState& state,
                             const Sliding& sliding, QuadraticModel& quadratic) {
  hands_ = {};
  const InstrumentStack& stack = rods.stack();
  for (int c = 0; c < stack.curves(); ++c) {
    const int n = state.curve(c).segments();
    std::vector<std::array<double, kMostInstruments>>& out =
        quadratic.curve(c).points.between.pressed_N;
    out.assign(n, {});
    const OnCurve on = CurveOf(rods, state, quadratic, c, loads_);
    if (n == 0 || on.range.last - on.range.first < 2) continue;
    pressed_N_.assign(n + 1, {});
    section_forces_ = {};
    FindCurveLoads(state, quadratic, c, loads_);
    BalanceAll(stack, on, sliding);
    // The force at a node is split equally between its two segments. At the last node it goes to
    // the last segment.
    for (int i = 0; i < n; ++i) {
      for (auto k = static_cast<std::size_t>(on.range.first);
           k < static_cast<std::size_t>(on.range.last); ++k) {
        out[i][k] = (i == 0 ? 0 : pressed_N_[i][k] / 2) +
                    (i + 1 == n ? pressed_N_[n][k] : pressed_N_[i + 1][k] / 2);
      }
    }
  }
}

void HandForces::Find(const CombinedRods& rods, const WireState& state,
                      const QuadraticModel& quadratic, const InternalForces& forces,
                      const Sliding& sliding) {
  hands_ = {};
  const int farthest = state.FarthestCurve();
  const InstrumentStack& stack = rods.stack();
  for (int c = 0; c < stack.curves(); ++c) {
    const int n = state.curve(c).segments();
    if (n == 0) continue;
    section_forces_ = {};
    pressed_N_.assign(n + 1, {});
    if (c != farthest) FindCurveLoads(state, quadratic, c, loads_);
    FindOnCurve(stack, CurveOf(rods, state, quadratic, c, c == farthest ? forces.loads : loads_),
                forces, sliding);
    const PointSet& points = quadratic.curve(c).points;
    const std::vector<double>& torque_mJ = forces.surface_torque_mJ[c];
    for (int q = 0; q < points.size(); ++q) {
      hands_[points.SurfaceAt(q)].torque_mJ -= torque_mJ[q];
    }
  }
  if (rods[0].spins() > 0) return;
  // Lumen friction turns surfaces that do not twist.
  for (const BetweenCurves& between : quadratic.between) {
    for (const BetweenCurves::Slide& slide : between.slides) {
      const Eigen::Vector2d& along_and_around_N = slide.load.gradient;
      hands_[slide.inner].torque_mJ += slide.inner_spin_mm.dot(along_and_around_N);
      hands_[slide.outer].torque_mJ += slide.outer_spin_mm.dot(along_and_around_N);
    }
  }
}

void HandForces::FindOnCurve(const InstrumentStack& stack, const OnCurve& on,
                             const InternalForces& forces, const Sliding& sliding) {
  const WireModel& rod = on.rod;
  const Curve& curve = on.curve;
  const Vector3d& entry = rod.sheath().direction;
  const Vector3d bend = Bend(entry, curve.tangents().front()) / JointLength(rod, curve, 0);
  if (stack.size() > 1) {
    BalanceAll(stack, on, sliding);
  } else {
    hands_[0].torque_mJ = forces.clamp_moment_mJ.dot(entry);
  }
  int leader = on.range.first;
  for (int k = leader + 1; k < on.range.last; ++k) {
    if (curve.poses()[k].insertion_mm > curve.poses()[leader].insertion_mm) leader = k;
  }
  double left_N = on.at.distal_gradient[0].dot(entry) -
                  rod.rigidity_N_mm2(curve.segments()) * bend.squaredNorm() / 2;
  for (const LumenLoad& load : on.loads.in_lumen) left_N += load.unfelt_N;
  for (int k = on.range.first; k < on.range.last; ++k) {
    const double twisted_N = TorsionalThrust(rod, curve, k);
    left_N -= twisted_N;
    if (k == leader) continue;
    const double inside_mm = curve.poses()[k].insertion_mm;
    if (inside_mm <= 0) continue;
    const double rigidity = SectionAt(stack.instrument(k).sections(), inside_mm).rigidity_N_mm2;
    hands_[k].axial_N = -(section_forces_[k].force_before_N + load_N_[k].front()).dot(entry) -
                        rigidity * bend.squaredNorm() / 2 - twisted_N;
    left_N -= hands_[k].axial_N;
  }
  // Makes the sum equal to the force of all instruments on the curve together.
  hands_[leader].axial_N = left_N;
}

}  // namespace torquer
