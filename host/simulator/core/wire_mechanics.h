// Energy of a wire in a vessel, with its derivatives: bending + wall + the terms of the effects.
//
// Unknowns: every tangent u_i on the unit sphere, moved by a step xi_i in its tangent plane,
//   u_i(xi) = u_i + T_i xi_i - |xi_i|^2/2 u_i + O(3),   T_i = [normal_i, second normal_i],
// so that lengths stay exact and node i + 1 moves by the sum of l_k T_k xi_k over k <= i. Joint i
// couples xi_{i-1} and xi_i; the points of segment i feel the displacement of node i and xi_i.
//
// Of a wire that does not twist the untwisted frames turn with the steps: a joint that rests curved
// feels all segments before it. What turns it goes back along the wire as a twisting moment.
//
// A wire that twists has normals that are fixed to its material, and one more unknown a segment:
// its spin zeta_i, which turns the normal about the tangent. Of a stack that twists each instrument
// has a spin, which turns it against the normal.
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

/// Second-order expansion of the wall's spring at a near point: what it is where the point touches,
/// and what it would be if the spring pulled as well as it pushes where it does not.
struct WallSpring {
  double stiffness_N_mm;    ///< k times the length that the point stands for
  double penetration_mm;    ///< negative: how far it is from touching
  Eigen::Matrix3d hessian;  ///< N/mm
};

/// Sums over the points of one segment, t their distance past its proximal node: of the gradient
/// g, of t g, and of H, t H, t^2 H. A load on the tangent itself adds its gradient to g1 and its
/// Hessian to h2.
struct LoadTerms {
  Eigen::Vector3d g0;
  Eigen::Vector3d g1;
  Eigen::Matrix3d h0;
  Eigen::Matrix3d h1;
  Eigen::Matrix3d h2;
};

/// The expansion of the whole energy at one state. Buffers are made once; no heap after that.
/// Of two curves the arrays of segments, joints and loads are those of the first; the second has
/// its own, in an Expansion without points, and between them is what holds them together.
struct Expansion {
  double energy_mJ = 0;      ///< what relaxing decreases
  double dissipated_mJ = 0;  ///< of this, what terms with EnergyTerm::Dissipates add
  double residual = 0;  ///< largest out-of-balance moment over the local EI/(1 mm) (torque, GJ)
  double max_penetration_mm = 0;   ///< of the wire's surface; 0 without contact
  std::vector<Frame> frames;       ///< n, one a segment
  std::vector<JointTerms> joints;  ///< n, one a joint; joint 0 has no proximal unknown
  std::vector<TwistTerms> twists;  ///< the same for a wire that twists; otherwise empty
  std::vector<TurnTerms> turns;    ///< the same for one that does not and rests curved somewhere
  std::vector<StackTerms> stack;   ///< the same for a stack that twists
  std::vector<int> load_index;     ///< n, into `loads`, -1 for a segment free of load
  std::vector<LoadTerms> loads;    ///< of the loaded segments
  std::vector<Eigen::Vector3d> distal_gradient;  ///< n + 1: sum of the gradients beyond node i,
                                                 ///< minus the internal force there; N
  std::vector<Eigen::Vector2d> gradient;         ///< n: d energy / d xi_i
  std::vector<double> spin_gradient;             ///< n times the model's spins: d energy / d zeta_i
  PointSet points;
  std::vector<WallSpring> springs;  ///< one for each of points.near
  PointDerivatives derivatives;     ///< of the terms, without the wall
  std::vector<Expansion> second;    ///< none, or that of the second curve
  BetweenCurves between;            ///< of two curves
};

/// Evaluates expansions. One per simulated wire; not for several threads at once.
class WireMechanics {
 public:
  /// Keeps references to all; `terms` may grow only before the first evaluation. `stack`: of
  /// instruments on two curves, of which `model` is the first rod; null where there is one.
  WireMechanics(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const std::vector<EnergyTerm*>& terms, const InstrumentStack* stack = nullptr);

  /// An expansion with room for the longest wire.
  Expansion MakeExpansion() const;

  /// Energy, gradient and Hessian blocks with the tangent planes given by state.normals.
  void Expand(const WireState& state, Expansion& out);
  /// Makes the loads those of the model in which exactly the near points with `active` (one a near
  /// point) feel the wall. Everything else stays that of the state.
  void Model(const WireState& state, const std::vector<std::uint8_t>& active, Expansion& out) const;
  /// The same of the places where two curves are near each other, one of Expansion::between.springs
  /// each.
  static void ModelBetween(const std::vector<std::uint8_t>& active, Expansion& out) {
    out.between.Sum([&active](std::size_t k) { return active[k] != 0; });
  }

  /// The same without Hessians (and without Hessian look-ups).
  void ExpandGradient(const WireState& state, Expansion& out);

  /// Where the wire may touch; see ContactPoints for what must be called after a move.
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
  std::unique_ptr<WireMechanics> second_;  // of the second rod
};

}  // namespace torquer
