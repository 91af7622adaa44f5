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
double PlaceOf(const WireModel& rod, const Curve& curve, int node) {
  return node == 0 ? 0 : curve.first_segment_mm() + (node - 1) * rod.segment_mm();
}

const Vector3d& TangentBefore(const WireModel& rod, const Curve& curve, int joint) {
  return joint == 0 ? rod.sheath().direction
                    : curve.tangents()[static_cast<std::size_t>(joint) - 1];
}

// Part of the push that a straight sheath takes if it holds an instrument only against turning: the
// energy of the twist per length, (34).
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

// Rest curvature of an instrument, as a rotation vector per length.
Vector3d RestCurvature(const WireModel& rod, const Curve& curve, int joint,
                       const WireModel::Joint& own, int instrument) {
  if (own.rest_rad == Vector2d::Zero()) return Vector3d::Zero();
  const Vector3d& tangent = TangentBefore(rod, curve, joint);
  const Vector3d& first =
      joint == 0 ? rod.sheath_normal() : curve.normals()[static_cast<std::size_t>(joint) - 1];
  const bool twists = rod.spins() > 0;
  const double turn_rad =
      twists ? curve.TurnBefore(joint, instrument) : curve.places()[instrument].rotation_rad;
  Vector2d rest = Turned(own.rest_rad, Vector2d(std::cos(turn_rad), std::sin(turn_rad)));
  if (!twists) {
    rest =
        Turned(rest, curve.reference_twist()[static_cast<std::size_t>(curve.segments() - joint)]);
  }
  return tangent.cross(rest[0] * first + rest[1] * tangent.cross(first)) / rod.segment_mm();
}

}  // namespace

HandForces::OnCurve HandForces::CurveOf(const InstrumentStack& stack, const WireState& state,
                                        const Expansion& expansion, int number,
                                        const CurveLoads& loads) {
  return {.rod = stack.rod(number),
          .curve = state.curve(number),
          .at = expansion.curve(number),
          .number = number,
          .range = stack.OnCurve(number),
          .loads = loads};
}

// Shares the loads between nodes by the lever rule, like the contacts. An instrument that touches
// the wall or the lumen takes the loads there; the outermost on a curve takes all others.
void HandForces::ShareLoads(const InstrumentStack& stack, const OnCurve& on) {
  const auto nodes = static_cast<std::size_t>(on.curve.segments()) + 1;
  for (int k = on.range.first; k < on.range.last; ++k) {
    load_N_[static_cast<std::size_t>(k)].assign(nodes, Vector3d::Zero());
  }
  const auto share = [&](int instrument, int segment, double part, const Vector3d& load_N) {
    const auto i = static_cast<std::size_t>(segment);
    std::vector<Vector3d>& loads_N = load_N_[static_cast<std::size_t>(instrument)];
    loads_N[i] += (1 - part) * load_N;
    loads_N[i + 1] += part * load_N;
  };
  const PointSet& points = on.at.points;
  for (int q = 0; q < points.size(); ++q) {
    const double part = static_cast<double>(q % points.per_segment + 1) / points.per_segment;
    share(points.SurfaceAt(q), q / points.per_segment, part,
          -on.loads.point_gradient_N[static_cast<std::size_t>(q)]);
  }
  const InstrumentPlaces& places = on.curve.places();
  for (const LumenLoad& load : on.loads.in_lumen) {
    const double arc_mm = PlaceOf(on.rod, on.curve, load.segment) + load.past_mm;
    const int instrument = load.in_own_lumen ? stack.LumenAt(on.number, places, arc_mm)
                                             : stack.SurfaceAt(on.number, places, arc_mm);
    share(
        instrument, load.segment, load.past_mm / on.curve.SegmentLength(on.rod, load.segment),
        load.force_N - load.unfelt_N * on.curve.tangents()[static_cast<std::size_t>(load.segment)]);
  }
}

// Finds the moment of each instrument at a joint. A joint that contains tips consists, as in the
// rod, of pieces in series with equal moments. The instruments in a piece determine its curvature.
void HandForces::FindMoments(const InstrumentStack& stack, const OnCurve& on, int joint) {
  const WireModel& rod = on.rod;
  const Curve& curve = on.curve;
  const double lambda = rod.segment_mm();
  const double length_mm = JointLength(rod, curve, joint);
  const double s = PlaceOf(rod, curve, joint);
  const Vector3d& before = TangentBefore(rod, curve, joint);
  const Vector3d& after = curve.tangents()[static_cast<std::size_t>(joint)];
  Vector3d curvature = Bend(before, after) / length_mm;
  double sum_EI = 0;
  Vector3d sum_EI_rest = Vector3d::Zero();
  double compliance = 0;
  std::array<double, kMostInstruments + 1> part = {};
  for (int m = 0; m < count_; ++m) {
    Share& share = shares_[static_cast<std::size_t>(m)];
    const int k = order_[static_cast<std::size_t>(m)];
    const InstrumentPlace& place = curve.places()[k];
    const double beyond_mm = place.insertion_mm - s;
    part[static_cast<std::size_t>(m)] = m == 0 ? 1 : std::clamp(beyond_mm / lambda + 0.5, 0.0, 1.0);
    const WireModel::Joint own = JointAt(stack.instrument(k), beyond_mm);
    share.rigidity_N_mm2 = own.rigidity_N_mm2;
    share.rest_1_mm = RestCurvature(rod, curve, joint, own, k);
  }
  for (int m = 0; m < count_; ++m) {
    const auto at = static_cast<std::size_t>(m);
    Share& share = shares_[at];
    sum_EI += share.rigidity_N_mm2;
    sum_EI_rest += share.rigidity_N_mm2 * share.rest_1_mm;
    share.piece = part[at] - part[at + 1];
    share.sum_EI = sum_EI;
    share.sum_EI_rest = sum_EI_rest;
    compliance += share.piece / sum_EI;
    curvature -= share.piece / sum_EI * sum_EI_rest;
  }
  const Vector3d moment_mJ = curvature / compliance;
  for (int m = 0; m < count_; ++m) {
    const auto at = static_cast<std::size_t>(m);
    const auto k = static_cast<std::size_t>(order_[at]);
    const Share& own = shares_[at];
    bears_[k].moment_before_mJ.setZero();
    bears_[k].inside = curve.places()[order_[at]].insertion_mm >= PlaceOf(rod, curve, joint + 1);
    for (std::size_t p = at; p < static_cast<std::size_t>(count_); ++p) {
      const Share& piece = shares_[p];
      if (piece.piece == 0) continue;
      const Vector3d bent = (moment_mJ + piece.sum_EI_rest) / piece.sum_EI;
      bears_[k].moment_before_mJ += piece.piece * own.rigidity_N_mm2 * (bent - own.rest_1_mm);
      hands_[k].torque_mJ -=
          piece.piece * length_mm * own.rigidity_N_mm2 * before.dot(own.rest_1_mm.cross(bent));
    }
  }
}

// Balances each instrument at a node: finds its force in the segment before the node.
void HandForces::Balance(const OnCurve& on, int node, const Sliding& sliding) {
  const Curve& curve = on.curve;
  constexpr int kRounds = 3;  // friction depends on the tension, which it changes
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = curve.tangents()[i - 1];
  const Vector3d& beyond = node < curve.segments() ? curve.tangents()[i] : curve.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  const double length_mm = (curve.nodes()[i] - curve.nodes()[i - 1]).norm();
  for (Bears& bears : bears_) bears.friction_N = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (int k = on.range.first; k < on.range.last; ++k) {
      Bears& bears = bears_[static_cast<std::size_t>(k)];
      const Vector3d shear_N = before.cross(bears.moment_mJ - bears.moment_before_mJ) / length_mm;
      const double axial_N = bears.force_N.dot(tangent) + bears.friction_N +
                             load_N_[static_cast<std::size_t>(k)][i].dot(tangent);
      bears.force_before_N =
          (axial_N - shear_N.dot(tangent)) / before.dot(tangent) * before + shear_N;
    }
    if (sliding.coefficient == 0) break;
    FindFriction(on, node, sliding);
  }
}

// Friction between instruments. Each is pressed against the next one around it by its own tension
// and by those of all within it. The contribution of their bending moments is left out. At a step
// of a rest shape or a rigidity it is a couple, with forces that grow as the clearance shrinks.
void HandForces::FindFriction(const OnCurve& on, int node, const Sliding& sliding) {
  const Curve& curve = on.curve;
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = curve.tangents()[i - 1];
  const Vector3d& beyond = node < curve.segments() ? curve.tangents()[i] : curve.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  for (Bears& bears : bears_) bears.friction_N = 0;
  Vector3d held_N = Vector3d::Zero();
  int inner = -1;
  for (int k = on.range.first; k < on.range.last; ++k) {
    Bears& bears = bears_[static_cast<std::size_t>(k)];
    if (!bears.inside) continue;
    if (inner >= 0) {
      const double pressed_N = held_N.norm();
      const double most_N = sliding.coefficient * pressed_N;
      pressed_N_[i][static_cast<std::size_t>(inner)] = pressed_N;
      const int way =
          sliding.direction[static_cast<std::size_t>(inner)][static_cast<std::size_t>(k)];
      bears_[static_cast<std::size_t>(inner)].friction_N -= way * most_N;
      bears.friction_N += way * most_N;
    }
    const Vector3d on_N = bears.force_before_N.dot(before) * before -
                          bears.force_N.dot(beyond) * beyond -
                          load_N_[static_cast<std::size_t>(k)][i];
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
    order_[static_cast<std::size_t>(count_++)] = k;
  }
  std::sort(order_.begin(), order_.begin() + count_, [&curve](int a, int b) {
    return curve.places()[a].insertion_mm > curve.places()[b].insertion_mm;
  });
  ShareLoads(stack, on);
  for (int i = curve.segments(); i > 0; --i) {
    for (Bears& bears : bears_) {
      bears.moment_mJ = bears.moment_before_mJ;
      bears.force_N = bears.force_before_N;
    }
    // The torque of an instrument that twists reaches its hand as its own torsion. The hand itself
    // turns the rest shape at the clamp.
    if (i == 1 && on.rod.spins() > 0) {
      for (int k = on.range.first; k < on.range.last; ++k) {
        hands_[static_cast<std::size_t>(k)].torque_mJ =
            -TwistStiffnessOf(on.rod, curve, 0, k) * curve.TwistOf(0, k);
      }
    }
    FindMoments(stack, on, i - 1);
    Balance(on, i, sliding);
  }
}

void HandForces::FindPressed(const InstrumentStack& stack, const WireState& state,
                             const Sliding& sliding, Expansion& expansion) {
  hands_ = {};
  for (int c = 0; c < stack.curves(); ++c) {
    const auto n = static_cast<std::size_t>(state.curve(c).segments());
    std::vector<std::array<double, kMostInstruments>>& out = expansion.curve(c).points.pressed_N;
    out.assign(n, {});
    const OnCurve on = CurveOf(stack, state, expansion, c, loads_);
    if (n == 0 || on.range.last - on.range.first < 2) continue;
    pressed_N_.assign(n + 1, {});
    bears_ = {};
    FindCurveLoads(state, expansion, c, loads_);
    BalanceAll(stack, on, sliding);
    // The force at a node is split equally between its two segments; that at the last node goes to
    // the last segment.
    for (std::size_t i = 0; i < n; ++i) {
      for (auto k = static_cast<std::size_t>(on.range.first);
           k < static_cast<std::size_t>(on.range.last); ++k) {
        out[i][k] = (i == 0 ? 0 : pressed_N_[i][k] / 2) +
                    (i + 1 == n ? pressed_N_[n][k] : pressed_N_[i + 1][k] / 2);
      }
    }
  }
}

void HandForces::Find(const InstrumentStack& stack, const WireState& state,
                      const Expansion& expansion, const InternalForces& forces,
                      const Sliding& sliding) {
  hands_ = {};
  const int farthest = state.FarthestCurve();
  for (int c = 0; c < stack.curves(); ++c) {
    const auto n = static_cast<std::size_t>(state.curve(c).segments());
    if (n == 0) continue;
    bears_ = {};
    pressed_N_.assign(n + 1, {});
    if (c != farthest) FindCurveLoads(state, expansion, c, loads_);
    FindOnCurve(stack, CurveOf(stack, state, expansion, c, c == farthest ? forces.loads : loads_),
                forces, sliding);
    const PointSet& points = expansion.curve(c).points;
    const std::vector<double>& torque_mJ = forces.surface_torque_mJ[static_cast<std::size_t>(c)];
    for (int q = 0; q < points.size(); ++q) {
      hands_[static_cast<std::size_t>(points.SurfaceAt(q))].torque_mJ -=
          torque_mJ[static_cast<std::size_t>(q)];
    }
  }
  if (stack.rod().spins() > 0) return;
  // Lumen friction turns surfaces that do not twist.
  for (const BetweenCurves& between : expansion.between) {
    for (const BetweenCurves::Slide& slide : between.slides) {
      const double around_N = slide.load.gradient[1];
      hands_[static_cast<std::size_t>(slide.inner)].torque_mJ += slide.inner_spin_mm * around_N;
      hands_[static_cast<std::size_t>(slide.outer)].torque_mJ += slide.outer_spin_mm * around_N;
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
    if (curve.places()[k].insertion_mm > curve.places()[leader].insertion_mm) leader = k;
  }
  double left_N = on.at.distal_gradient[0].dot(entry) -
                  rod.rigidity_N_mm2(curve.segments()) * bend.squaredNorm() / 2;
  for (const LumenLoad& load : on.loads.in_lumen) left_N += load.unfelt_N;
  for (int k = on.range.first; k < on.range.last; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double twisted_N = TorsionalThrust(rod, curve, k);
    left_N -= twisted_N;
    if (k == leader) continue;
    const double inside_mm = curve.places()[k].insertion_mm;
    if (inside_mm <= 0) continue;
    const double rigidity = JointAt(stack.instrument(k), inside_mm).rigidity_N_mm2;
    hands_[at].axial_N = -(bears_[at].force_before_N + load_N_[at].front()).dot(entry) -
                         rigidity * bend.squaredNorm() / 2 - twisted_N;
    left_N -= hands_[at].axial_N;
  }
  // Makes the sum equal to the force of all instruments on the curve together.
  hands_[static_cast<std::size_t>(leader)].axial_N = left_N;
}

}  // namespace torquer
