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
double PlaceOf(const WireModel& rod, const WireState& state, int node) {
  return node == 0 ? 0 : state.first_segment_mm() + (node - 1) * rod.segment_mm();
}

const Vector3d& TangentBefore(const WireModel& rod, const WireState& state, int joint) {
  return joint == 0 ? rod.sheath().direction
                    : state.tangents()[static_cast<std::size_t>(joint) - 1];
}

// Part of the push that a straight sheath takes if it holds an instrument only against turning: the
// energy of the twist per length, (34).
double TorsionalThrust(const WireModel& rod, const WireState& state, int instrument) {
  if (rod.spins() == 0) return 0;
  const double twist_rad = state.TwistOf(0, instrument);
  return TwistStiffnessOf(rod, state, 0, instrument) * twist_rad * twist_rad /
         (2 * JointLength(rod, state, 0));
}

// Bend of a joint, as a rotation vector.
Vector3d Bend(const Vector3d& before, const Vector3d& after) {
  const Vector3d axis = before.cross(after);
  const double sine = axis.norm();
  return sine > 0 ? Vector3d(std::atan2(sine, before.dot(after)) / sine * axis) : axis;
}

// Rest curvature of an instrument, as a rotation vector per length.
Vector3d RestCurvature(const WireModel& rod, const WireState& state, int joint,
                       const WireModel::Joint& own, int instrument) {
  if (own.rest_rad == Vector2d::Zero()) return Vector3d::Zero();
  const Vector3d& tangent = TangentBefore(rod, state, joint);
  const Vector3d& first =
      joint == 0 ? rod.sheath_normal() : state.normals()[static_cast<std::size_t>(joint) - 1];
  const bool twists = rod.spins() > 0;
  const double turn_rad =
      twists ? state.TurnBefore(joint, instrument) : state.places()[instrument].rotation_rad;
  Vector2d rest = Turned(own.rest_rad, Vector2d(std::cos(turn_rad), std::sin(turn_rad)));
  if (!twists) {
    rest =
        Turned(rest, state.reference_twist()[static_cast<std::size_t>(state.segments() - joint)]);
  }
  return tangent.cross(rest[0] * first + rest[1] * tangent.cross(first)) / rod.segment_mm();
}

}  // namespace

HandForces::Curve HandForces::CurveOf(const InstrumentStack& stack, const WireState& state,
                                      const Expansion& expansion, bool second,
                                      const CurveLoads& loads) {
  return {.rod = second ? *stack.second_rod() : stack.rod(),
          .state = second ? *state.second() : state,
          .at = second ? expansion.second.front() : expansion,
          .second = second,
          .range = stack.OnCurve(second != state.outer_leads()),
          .loads = loads};
}

// Shares the loads between nodes by the lever rule, like the contacts. An instrument that touches
// the wall or the lumen takes the loads there; the outermost on a curve takes all others.
void HandForces::ShareLoads(const InstrumentStack& stack, const Curve& curve,
                            const PointSet& points) {
  const auto nodes = static_cast<std::size_t>(curve.state.segments()) + 1;
  for (int k = curve.range.first; k < curve.range.last; ++k) {
    load_N_[static_cast<std::size_t>(k)].assign(nodes, Vector3d::Zero());
  }
  const auto share = [&](int instrument, int segment, double part, const Vector3d& load_N) {
    const auto i = static_cast<std::size_t>(segment);
    std::vector<Vector3d>& on = load_N_[static_cast<std::size_t>(instrument)];
    on[i] += (1 - part) * load_N;
    on[i + 1] += part * load_N;
  };
  for (int q = 0; q < points.SizeOf(curve.second); ++q) {
    const double part = static_cast<double>(q % points.per_segment + 1) / points.per_segment;
    share(points.OutermostAt(curve.range.first, curve.range.last, q), q / points.per_segment, part,
          -curve.loads.point_gradient_N[static_cast<std::size_t>(q)]);
  }
  const InstrumentPlaces& places = curve.state.places();
  for (const LumenLoad& load : curve.loads.in_lumen) {
    const double arc_mm = PlaceOf(curve.rod, curve.state, load.segment) + load.past_mm;
    const int instrument =
        curve.range.first > 0 ? stack.LumenAt(places, arc_mm) : stack.InLumenAt(places, arc_mm);
    const Vector3d& tangent = curve.state.tangents()[static_cast<std::size_t>(load.segment)];
    share(instrument, load.segment,
          load.past_mm / curve.state.SegmentLength(curve.rod, load.segment),
          load.force_N - load.unfelt_N * tangent);
  }
}

// Finds the moment of each instrument at a joint. A joint that contains tips consists, as in the
// rod, of pieces in series with equal moments. The instruments in a piece determine its curvature.
void HandForces::FindMoments(const InstrumentStack& stack, const Curve& curve, int joint) {
  const WireModel& rod = curve.rod;
  const WireState& state = curve.state;
  const double lambda = rod.segment_mm();
  const double length_mm = JointLength(rod, state, joint);
  const double s = PlaceOf(rod, state, joint);
  const Vector3d& before = TangentBefore(rod, state, joint);
  const Vector3d& after = state.tangents()[static_cast<std::size_t>(joint)];
  Vector3d curvature = Bend(before, after) / length_mm;
  double sum_EI = 0;
  Vector3d sum_EI_rest = Vector3d::Zero();
  double compliance = 0;
  std::array<double, kMostInstruments + 1> part = {};
  for (int m = 0; m < count_; ++m) {
    Share& share = shares_[static_cast<std::size_t>(m)];
    const int k = order_[static_cast<std::size_t>(m)];
    const InstrumentPlace& place = state.places()[k];
    const double beyond_mm = place.insertion_mm - s;
    part[static_cast<std::size_t>(m)] = m == 0 ? 1 : std::clamp(beyond_mm / lambda + 0.5, 0.0, 1.0);
    const WireModel::Joint own = JointAt(stack.instrument(k), beyond_mm);
    share.rigidity_N_mm2 = own.rigidity_N_mm2;
    share.rest_1_mm = RestCurvature(rod, state, joint, own, k);
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
    bears_[k].inside = state.places()[order_[at]].insertion_mm >= PlaceOf(rod, state, joint + 1);
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
void HandForces::Balance(const Curve& curve, int node, const Sliding& sliding) {
  const WireState& state = curve.state;
  constexpr int kRounds = 3;  // friction depends on the tension, which it changes
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = state.tangents()[i - 1];
  const Vector3d& beyond = node < state.segments() ? state.tangents()[i] : state.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  const double length_mm = (state.nodes()[i] - state.nodes()[i - 1]).norm();
  for (Bears& bears : bears_) bears.friction_N = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (int k = curve.range.first; k < curve.range.last; ++k) {
      Bears& bears = bears_[static_cast<std::size_t>(k)];
      const Vector3d shear_N = before.cross(bears.moment_mJ - bears.moment_before_mJ) / length_mm;
      const double axial_N = bears.force_N.dot(tangent) + bears.friction_N +
                             load_N_[static_cast<std::size_t>(k)][i].dot(tangent);
      bears.force_before_N =
          (axial_N - shear_N.dot(tangent)) / before.dot(tangent) * before + shear_N;
    }
    if (sliding.coefficient == 0) break;
    FindFriction(curve, node, sliding);
  }
}

// Friction between instruments. Each is pressed against the next one around it by its own tension
// and by those of all within it. The contribution of their bending moments is left out. At a step
// of a rest shape or a rigidity it is a couple, with forces that grow as the clearance shrinks.
void HandForces::FindFriction(const Curve& curve, int node, const Sliding& sliding) {
  const WireState& state = curve.state;
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = state.tangents()[i - 1];
  const Vector3d& beyond = node < state.segments() ? state.tangents()[i] : state.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  for (Bears& bears : bears_) bears.friction_N = 0;
  Vector3d held_N = Vector3d::Zero();
  int inner = -1;
  for (int k = curve.range.first; k < curve.range.last; ++k) {
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
  const std::size_t places = BetweenCurves::MostPlaces(segments, points_per_segment);
  for (CurveLoads* const loads : {&loads_, &second_loads_}) loads->Reserve(points, places);
}

// Balances all instruments of a curve, from the tip to the sheath.
void HandForces::BalanceAll(const InstrumentStack& stack, const Curve& curve,
                            const PointSet& points, const Sliding& sliding) {
  const WireState& state = curve.state;
  count_ = 0;
  for (int k = curve.range.first; k < curve.range.last; ++k) {
    order_[static_cast<std::size_t>(count_++)] = k;
  }
  std::sort(order_.begin(), order_.begin() + count_, [&state](int a, int b) {
    return state.places()[a].insertion_mm > state.places()[b].insertion_mm;
  });
  ShareLoads(stack, curve, points);
  for (int i = state.segments(); i > 0; --i) {
    for (Bears& bears : bears_) {
      bears.moment_mJ = bears.moment_before_mJ;
      bears.force_N = bears.force_before_N;
    }
    // The torque of an instrument that twists reaches its hand as its own torsion. The hand itself
    // turns the rest shape at the clamp.
    if (i == 1 && curve.rod.spins() > 0) {
      for (int k = curve.range.first; k < curve.range.last; ++k) {
        hands_[static_cast<std::size_t>(k)].torque_mJ =
            -TwistStiffnessOf(curve.rod, state, 0, k) * state.TwistOf(0, k);
      }
    }
    FindMoments(stack, curve, i - 1);
    Balance(curve, i, sliding);
  }
}

void HandForces::FindPressed(const InstrumentStack& stack, const WireState& state,
                             const Expansion& expansion, const Sliding& sliding,
                             std::vector<std::array<double, kMostInstruments>>& out) {
  const auto n = static_cast<std::size_t>(state.segments());
  hands_ = {};
  out.assign(n, {});
  pressed_N_.assign(n + 1, {});
  for (const bool second : {false, true}) {
    if (second && state.second() == nullptr) continue;
    CurveLoads& loads = second ? second_loads_ : loads_;
    const Curve curve = CurveOf(stack, state, expansion, second, loads);
    const auto own = static_cast<std::size_t>(curve.state.segments());
    if (own == 0 || curve.range.last - curve.range.first < 2) continue;
    bears_ = {};
    FindCurveLoads(state, expansion, second, loads);
    BalanceAll(stack, curve, expansion.points, sliding);
    // The force at a node is split equally between its two segments; that at the last node goes to
    // the last segment.
    for (std::size_t i = 0; i < own; ++i) {
      for (auto k = static_cast<std::size_t>(curve.range.first);
           k < static_cast<std::size_t>(curve.range.last); ++k) {
        out[i][k] = (i == 0 ? 0 : pressed_N_[i][k] / 2) +
                    (i + 1 == own ? pressed_N_[own][k] : pressed_N_[i + 1][k] / 2);
      }
    }
  }
}

void HandForces::Find(const InstrumentStack& stack, const WireState& state,
                      const Expansion& expansion, const InternalForces& forces,
                      const Sliding& sliding) {
  const PointSet& points = expansion.points;
  hands_ = {};
  bears_ = {};
  if (state.segments() == 0) return;
  pressed_N_.assign(static_cast<std::size_t>(state.segments()) + 1, {});
  FindOnCurve(stack, CurveOf(stack, state, expansion, false, forces.loads), points, forces,
              sliding);
  if (state.second() != nullptr && state.second()->segments() > 0) {
    FindCurveLoads(state, expansion, true, second_loads_);
    bears_ = {};
    FindOnCurve(stack, CurveOf(stack, state, expansion, true, second_loads_), points, forces,
                sliding);
  }
  for (int q = 0; q < points.size(); ++q) {
    hands_[static_cast<std::size_t>(points.SurfaceAt(q))].torque_mJ -=
        forces.surface_torque_mJ[static_cast<std::size_t>(q)];
  }
  if (stack.rod().spins() > 0) return;
  // Lumen friction turns surfaces that do not twist.
  for (const BetweenCurves::Slide& slide : expansion.between.slides) {
    const LumenContact& contact = points.lumen[static_cast<std::size_t>(slide.load.place)];
    const double around_N = slide.load.gradient[1];
    hands_[static_cast<std::size_t>(contact.inner)].torque_mJ += slide.inner_spin_mm * around_N;
    hands_[static_cast<std::size_t>(contact.outer)].torque_mJ += slide.outer_spin_mm * around_N;
  }
}

void HandForces::FindOnCurve(const InstrumentStack& stack, const Curve& curve,
                             const PointSet& points, const InternalForces& forces,
                             const Sliding& sliding) {
  const WireModel& rod = curve.rod;
  const WireState& state = curve.state;
  const Vector3d& entry = rod.sheath().direction;
  const Vector3d bend = Bend(entry, state.tangents().front()) / JointLength(rod, state, 0);
  if (stack.size() > 1) {
    BalanceAll(stack, curve, points, sliding);
  } else {
    hands_[0].torque_mJ = forces.clamp_moment_mJ.dot(entry);
  }
  int leader = curve.range.first;
  for (int k = leader + 1; k < curve.range.last; ++k) {
    if (state.places()[k].insertion_mm > state.places()[leader].insertion_mm) leader = k;
  }
  double left_N = curve.at.distal_gradient[0].dot(entry) -
                  rod.rigidity_N_mm2(state.segments()) * bend.squaredNorm() / 2;
  for (const LumenLoad& load : curve.loads.in_lumen) left_N += load.unfelt_N;
  for (int k = curve.range.first; k < curve.range.last; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const double twisted_N = TorsionalThrust(rod, state, k);
    left_N -= twisted_N;
    if (k == leader) continue;
    const double inside_mm = state.places()[k].insertion_mm;
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
