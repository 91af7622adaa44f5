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

// What a straight sheath that lets an instrument through, but holds it against a turn, takes of the
// push: the energy of its twist per length, (34).
double TorsionalThrust(const WireModel& rod, const WireState& state, int instrument) {
  if (rod.spins() == 0) return 0;
  const double twist_rad = state.TwistOf(0, instrument);
  return TwistStiffnessOf(rod, state, 0, instrument) * twist_rad * twist_rad /
         (2 * JointLength(rod, state, 0));
}

// The bend of a joint, as a rotation vector.
Vector3d Bend(const Vector3d& before, const Vector3d& after) {
  const Vector3d axis = before.cross(after);
  const double sine = axis.norm();
  return sine > 0 ? Vector3d(std::atan2(sine, before.dot(after)) / sine * axis) : axis;
}

// The curvature, as a rotation vector over a length, at which an instrument rests.
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

// By the lever, as the contacts: an instrument that touches the wall bears what acts there.
void HandForces::ShareLoads(const PointSet& points, const std::vector<Vector3d>& point_gradient_N,
                            std::size_t nodes) {
  for (int k = 0; k < count_; ++k) {
    load_N_[static_cast<std::size_t>(k)].assign(nodes, Vector3d::Zero());
  }
  for (int q = 0; q < points.size(); ++q) {
    const Vector3d load_N = -point_gradient_N[static_cast<std::size_t>(q)];
    const auto i = static_cast<std::size_t>(q / points.per_segment);
    const double t = static_cast<double>(q % points.per_segment + 1) / points.per_segment;
    std::vector<Vector3d>& on = load_N_[static_cast<std::size_t>(points.SurfaceAt(q))];
    on[i] += (1 - t) * load_N;
    on[i + 1] += t * load_N;
  }
}

// The moment of each instrument at a joint. A joint into which tips fall is, as the rod has it, one
// piece after the other, all with the same moment: each as curved as those that lie in it make it.
void HandForces::FindMoments(const InstrumentStack& stack, const WireState& state, int joint) {
  const WireModel& rod = stack.rod();
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

// What the balance of a node asks of each instrument in the segment before it.
void HandForces::Balance(const WireState& state, int node, const Sliding& sliding) {
  constexpr int kRounds = 3;  // friction depends on the tension that it makes
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = state.tangents()[i - 1];
  const Vector3d& beyond = node < state.segments() ? state.tangents()[i] : state.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  const double length_mm = (state.nodes()[i] - state.nodes()[i - 1]).norm();
  for (Bears& bears : bears_) bears.friction_N = 0;
  for (int round = 0; round < kRounds; ++round) {
    for (int k = 0; k < count_; ++k) {
      Bears& bears = bears_[static_cast<std::size_t>(k)];
      const Vector3d shear_N = before.cross(bears.moment_mJ - bears.moment_before_mJ) / length_mm;
      const double axial_N = bears.force_N.dot(tangent) + bears.friction_N +
                             load_N_[static_cast<std::size_t>(k)][i].dot(tangent);
      bears.force_before_N =
          (axial_N - shear_N.dot(tangent)) / before.dot(tangent) * before + shear_N;
    }
    if (sliding.coefficient == 0) break;
    FindFriction(state, node, sliding);
  }
}

// Each is pressed against the next one around it by the tensions of it and of all within it. What
// their bending moments add is left out: where a rest shape or a rigidity steps it is a couple,
// whose forces are the larger the smaller the clearance is.
void HandForces::FindFriction(const WireState& state, int node, const Sliding& sliding) {
  const auto i = static_cast<std::size_t>(node);
  const Vector3d& before = state.tangents()[i - 1];
  const Vector3d& beyond = node < state.segments() ? state.tangents()[i] : state.tangents()[i - 1];
  const Vector3d tangent = (before + beyond).normalized();
  for (Bears& bears : bears_) bears.friction_N = 0;
  Vector3d held_N = Vector3d::Zero();
  int inner = -1;
  for (int k = 0; k < count_; ++k) {
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

void HandForces::Reserve(int segments) {
  const auto nodes = static_cast<std::size_t>(segments) + 1;
  for (std::vector<Vector3d>& load_N : load_N_) load_N.reserve(nodes);
  pressed_N_.reserve(nodes);
}

// From the tip to the sheath.
void HandForces::BalanceAll(const InstrumentStack& stack, const WireState& state,
                            const PointSet& points, const std::vector<Vector3d>& point_gradient_N,
                            const Sliding& sliding) {
  const int n = state.segments();
  const WireModel& rod = stack.rod();
  for (int k = 0; k < count_; ++k) order_[static_cast<std::size_t>(k)] = k;
  std::sort(order_.begin(), order_.begin() + count_, [&state](int a, int b) {
    return state.places()[a].insertion_mm > state.places()[b].insertion_mm;
  });
  const auto nodes = static_cast<std::size_t>(n) + 1;
  ShareLoads(points, point_gradient_N, nodes);
  pressed_N_.assign(nodes, {});
  for (int i = n; i > 0; --i) {
    for (Bears& bears : bears_) {
      bears.moment_mJ = bears.moment_before_mJ;
      bears.force_N = bears.force_before_N;
    }
    // What turns an instrument that twists comes to its hand as its own torsion; the rest shape
    // at the clamp is turned by the hand itself.
    if (i == 1 && rod.spins() > 0) {
      for (int k = 0; k < count_; ++k) {
        hands_[static_cast<std::size_t>(k)].torque_mJ =
            -TwistStiffnessOf(rod, state, 0, k) * state.TwistOf(0, k);
      }
    }
    FindMoments(stack, state, i - 1);
    Balance(state, i, sliding);
  }
}

void HandForces::FindPressed(const InstrumentStack& stack, const WireState& state,
                             const PointSet& points, const std::vector<Vector3d>& point_gradient_N,
                             const Sliding& sliding,
                             std::vector<std::array<double, kMostInstruments>>& out) {
  const auto n = static_cast<std::size_t>(state.segments());
  count_ = stack.size();
  hands_ = {};
  bears_ = {};
  out.assign(n, {});
  if (n == 0) return;
  BalanceAll(stack, state, points, point_gradient_N, sliding);
  // A node's is half that of each segment beside it, the last one's all of the last.
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t k = 0; k < out[i].size(); ++k) {
      out[i][k] = (i == 0 ? 0 : pressed_N_[i][k] / 2) +
                  (i + 1 == n ? pressed_N_[n][k] : pressed_N_[i + 1][k] / 2);
    }
  }
}

void HandForces::Find(const InstrumentStack& stack, const WireState& state, const PointSet& points,
                      const InternalForces& forces, const Sliding& sliding) {
  const int n = state.segments();
  count_ = stack.size();
  hands_ = {};
  bears_ = {};
  if (n == 0) return;
  const WireModel& rod = stack.rod();
  const Vector3d& entry = rod.sheath().direction;
  const Vector3d bend = Bend(entry, state.tangents().front()) / JointLength(rod, state, 0);
  const auto leader = static_cast<std::size_t>(state.places().Leader());
  if (count_ > 1) {
    BalanceAll(stack, state, points, forces.point_gradient_N, sliding);
  } else {
    hands_[0].torque_mJ = forces.clamp_moment_mJ.dot(entry);
  }
  for (int q = 0; q < points.size(); ++q) {
    hands_[static_cast<std::size_t>(points.SurfaceAt(q))].torque_mJ -=
        forces.surface_torque_mJ[static_cast<std::size_t>(q)];
  }
  double left_N = forces.clamp_force_N.dot(entry) - rod.rigidity_N_mm2(n) * bend.squaredNorm() / 2;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count_); ++k) {
    const double twisted_N = TorsionalThrust(rod, state, static_cast<int>(k));
    left_N -= twisted_N;
    if (k == leader) continue;
    const double inside_mm = state.places()[static_cast<int>(k)].insertion_mm;
    if (inside_mm <= 0) continue;
    const double rigidity =
        JointAt(stack.instrument(static_cast<int>(k)), inside_mm).rigidity_N_mm2;
    hands_[k].axial_N = -(bears_[k].force_before_N + load_N_[k].front()).dot(entry) -
                        rigidity * bend.squaredNorm() / 2 - twisted_N;
    left_N -= hands_[k].axial_N;
  }
  hands_[leader].axial_N = left_N;  // so that the sum is that of all together
}

}  // namespace torquer
