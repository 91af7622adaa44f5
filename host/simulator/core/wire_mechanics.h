// Energy of a wire in a vessel, with its derivatives: bending + wall + the terms of the effects.
//
// Unknowns: every tangent u_i on the unit sphere, moved by a step xi_i in its tangent plane,
//   u_i(xi) = u_i + T_i xi_i - |xi_i|^2/2 u_i + O(3),   T_i = [normal_i, second normal_i],
// so that lengths stay exact and node i + 1 moves by the sum of l_k T_k xi_k over k <= i. Joint i
// couples xi_{i-1} and xi_i; the points of segment i feel the displacement of node i and xi_i.
//
// The untwisted frames of a wire that does not twist turn with the steps. So a joint that rests
// curved depends on all segments before it. Its effect goes back along the wire as a twisting
// moment.
//
// A wire that twists has normals that are fixed to its material, and one more unknown per segment.
// This is its spin zeta_i, which turns the normal about the tangent. In a stack that twists each
// instrument has a spin, which turns it against the normal.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/contact_points.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/joint_terms.h"
#include "host/simulator/core/stack/between_curves.h"
#include "host/simulator/core/stack/stack_terms.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Second-order expansion of the wall's spring at a near point. If the point does not touch, it is
/// the expansion of a spring that also pulls.
struct WallSpring {
  double stiffness_N_mm;    ///< k times the length that the point stands for
  double penetration_mm;    ///< negative: minus the distance to contact
  Eigen::Matrix3d hessian;  ///< N/mm
};

/// Sums over the points of one segment of the gradient g and Hessian H: g, t g, H, t H, t^2 H. t is
/// the distance of a point past the segment's proximal node. A load on the tangent itself adds its
/// gradient to g1 and its Hessian to h2.
struct LoadTerms {
  Eigen::Vector3d g0;
  Eigen::Vector3d g1;
  Eigen::Matrix3d h0;
  Eigen::Matrix3d h1;
  Eigen::Matrix3d h2;
};

/// Expansion of the whole energy at one state. Buffers are allocated once; no heap after that. For
/// two curves, the arrays of segments, joints and loads are those of the first curve. The second
/// curve has its own Expansion, without points. `between` couples the two.
struct Expansion {
  double energy_mJ = 0;      ///< the quantity that relaxing decreases
  double dissipated_mJ = 0;  ///< its part from terms with EnergyTerm::Dissipates
  double residual = 0;  ///< largest out-of-balance moment over the local EI/(1 mm) (torque, GJ)
  double max_penetration_mm = 0;   ///< of the wire's surface; 0 without contact
  std::vector<Frame> frames;       ///< n, one per segment
  std::vector<JointTerms> joints;  ///< n, one per joint; joint 0 has no proximal unknown
  std::vector<TwistTerms> twists;  ///< n, one per joint of a wire that twists; otherwise empty
  std::vector<TurnTerms> turns;    ///< n, for a wire that does not twist and rests curved somewhere
  std::vector<StackTerms> stack;   ///< n, for a stack that twists
  std::vector<int> load_index;     ///< n, into `loads`, -1 for a segment free of load
  std::vector<LoadTerms> loads;    ///< of the loaded segments
  std::vector<Eigen::Vector3d> distal_gradient;  ///< n + 1: sum of the gradients beyond node i,
                                                 ///< minus the internal force there; N
  std::vector<Eigen::Vector2d> gradient;         ///< n: d energy / d xi_i
  std::vector<double> spin_gradient;             ///< n times the model's spins: d energy / d zeta_i
  PointSet points;
  std::vector<WallSpring> springs;  ///< one for each of points.near
  PointDerivatives derivatives;     ///< of the terms, without the wall
  std::vector<Expansion> second;    ///< empty, or one entry: that of the second curve
  BetweenCurves between;            ///< contact between two curves
};

/// Evaluates expansions. One per simulated wire; not thread-safe.
class WireMechanics {
 public:
  /// Keeps references to all; `terms` may grow only before the first evaluation. `stack`:
  /// instruments on two curves, with `model` as the first rod; null for one curve.
  WireMechanics(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const std::vector<EnergyTerm*>& terms, const InstrumentStack* stack = nullptr);

  /// Returns an expansion with room for the longest wire.
  Expansion MakeExpansion() const;

  /// Energy, gradient and Hessian blocks with the tangent planes given by state.normals.
  void Expand(const WireState& state, Expansion& out);
  /// Replaces the loads by those of the model in which the wall acts on exactly the near points
  /// with `active`. `active` has one entry per near point. Everything else stays that of the state.
  void Model(const WireState& state, const std::vector<std::uint8_t>& active, Expansion& out) const;
  /// Like Model, for the springs between two curves. `active` has one entry per spring of
  /// Expansion::between.springs.
  static void ModelBetween(const std::vector<std::uint8_t>& active, Expansion& out) {
    out.between.Sum([&active](std::size_t k) { return active[k] != 0; });
  }

  /// Like Expand, without Hessians and Hessian look-ups.
  void ExpandGradient(const WireState& state, Expansion& out);

  /// The contact points; see ContactPoints for the calls needed after a move.
  ContactPoints& points() { return points_; }
  const ContactPoints& points() const { return points_; }

  const WireModel& model() const { return model_; }
  const WallModel& wall() const { return wall_; }

 private:
  void PrepareSegments(const WireState& state, Expansion& out) const;
  void ExpandBending(const WireState& state, Expansion& out) const;
  void ExpandJoints(const WireState& state, Expansion& out) const;
  void ExpandTurningJoints(const WireState& state, Expansion& out) const;
  RestSpinTerms SpinOfRestAt(const WireState& state, int joint, const Expansion& at) const;
  void ExpandTwists(const WireState& state, Expansion& out) const;
  void ExpandStack(const WireState& state, Expansion& out) const;
  double SumSpins(const WireState& state, int segment, Expansion& out) const;
  void AddSpinLoads(const WireState& state, Expansion& out) const;
  void AddBetweenLoads(Expansion& out) const;
  void AddSlideLoads(const WireState& state, Expansion& out) const;
  bool SlidesInLumen() const;
  void ExpandWall(bool with_hessian, Expansion& out) const;
  void AddLoad(int point, bool on_second, double length_mm, const Eigen::Vector3d& gradient,
               const Eigen::Matrix3d* hessian, Expansion& out) const;
  void AddLoads(const WireState& state, const PositionDerivatives& loads, bool covered,
                Expansion& out) const;
  LoadTerms& LoadsOf(int segment, Expansion& out) const;
  template <class IsActive>
  void SumLoads(const WireState& state, IsActive is_active, Expansion& out) const;
  void ExpandSecond(const WireState& state, Expansion& out) const;
  double SumGradient(const WireState& state, Expansion& out) const;
  double SumGradient(const WireState& state, const BetweenCurves* between, Eigen::Index part,
                     Expansion& out) const;
  void SumTrueGradient(const WireState& state, Expansion& out) const;
  void ExpandAll(const WireState& state, bool with_hessian, Expansion& out);

  const WireModel& model_;
  const WallModel& wall_;
  const std::vector<EnergyTerm*>& terms_;
  const InstrumentStack* stack_;
  const Frame sheath_frame_;
  ContactPoints points_;
  std::unique_ptr<WireMechanics> second_;  // for the second rod
};

}  // namespace torquer
