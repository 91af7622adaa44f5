// Energy of a wire in a vessel, with its derivatives: bending + wall + the terms of the effects.
//
// Unknowns: every tangent u_i on the unit sphere, moved by a step xi_i in its tangent plane,
//   u_i(xi) = u_i + T_i xi_i - |xi_i|^2/2 u_i + O(3),   T_i = [normal_i, second normal_i],
// so that lengths stay exact and node i + 1 moves by the sum of l_k T_k xi_k over k <= i. Joint i
// couples xi_{i-1} and xi_i; the points of segment i feel the displacement of node i and xi_i.
//
// A wire that twists has normals that are fixed to its material, and one more unknown a segment:
// its spin zeta_i, which turns the normal about the tangent.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Points closer to touching than this are `near`: the next step may make them touch.
inline constexpr double kNearMm = 0.05;

/// Where the wall is stiffer or softer.
class WallStiffness {
 public:
  virtual ~WallStiffness() = default;
  /// k at a place of the vessel, N/mm^2, > 0.
  virtual double At(const Eigen::Vector3d& point_mm) const = 0;
};

/// The wall as a spring: U = 1/2 k (length of wire) penetration^2 for every contact point.
struct WallModel {
  double stiffness_N_mm2 = 1;  ///< k, per length of wire; 1e-6 .. 1e3
  int points_per_segment = 2;  ///< contact points; 1 .. 8. One, as in the paper, makes sliding
                               ///< rugged with the period of the segments.
  /// Instead of stiffness_N_mm2, where it is not the same everywhere. Taken over by every contact
  /// point when the wire is moved, and constant until it is moved again.
  const WallStiffness* by_place = nullptr;
};

/// The tangent plane of a segment: its normal and second normal (tangent x normal) as columns.
using Frame = Eigen::Matrix<double, 3, 2, Eigen::RowMajor>;

Frame TangentFrame(const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal);

/// Second-order expansion of the energy of joint i in xi_{i-1} (proximal) and xi_i (distal), mJ.
struct JointTerms {
  Eigen::Vector2d gradient_proximal;
  Eigen::Vector2d gradient_distal;
  Eigen::Matrix2d hessian_proximal;
  Eigen::Matrix2d hessian_distal;
  Eigen::Matrix<double, 2, 2, Eigen::RowMajor> hessian_cross;  ///< rows: proximal, columns: distal
};

/// What the spins zeta_{i-1} and zeta_i of the segments of joint i add to its expansion, for a wire
/// that twists: turns about the tangents as they are after the steps xi. mJ.
struct TwistTerms {
  double gradient_proximal;
  double gradient_distal;
  double hessian_proximal;
  double hessian_distal;
  double hessian_cross;
  Eigen::Vector2d proximal_proximal;  ///< d2 / d zeta_{i-1} d xi_{i-1}
  Eigen::Vector2d proximal_distal;    ///< d2 / d zeta_{i-1} d xi_i
  Eigen::Vector2d distal_proximal;    ///< d2 / d zeta_i d xi_{i-1}
  Eigen::Vector2d distal_distal;      ///< d2 / d zeta_i d xi_i
  /// d2 / d zeta_i d (displacement of node i); loads on the segment alone have it. N.
  Eigen::Vector3d distal_displacement;
};

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
struct Expansion {
  double energy_mJ = 0;
  double curved_joints_mJ = 0;  ///< of this, the joints that rest curved
  double residual = 0;  ///< largest out-of-balance moment over the local EI/(1 mm) (torque, GJ)
  double max_penetration_mm = 0;          ///< of the wire's surface; 0 without contact
  std::vector<Frame> frames;              ///< n, one a segment
  std::vector<JointTerms> joints;         ///< n, one a joint; joint 0 has no proximal unknown
  std::vector<TwistTerms> twists;         ///< the same for a wire that twists; otherwise empty
  std::vector<int> load_index;            ///< n, into `loads`, -1 for a segment free of load
  std::vector<LoadTerms> loads;           ///< of the loaded segments
  std::vector<Eigen::Vector3d> costate;   ///< n + 1: sum of the gradients beyond node i
  std::vector<Eigen::Vector2d> gradient;  ///< n: d energy / d xi_i
  std::vector<double> spin_gradient;      ///< n: d energy / d zeta_i, for a wire that twists
  PointSet points;
  std::vector<WallSpring> springs;  ///< one for each of points.near
  PointDerivatives derivatives;     ///< of the terms, without the wall
};

/// Evaluates expansions. One per simulated wire; not for several threads at once.
class WireMechanics {
 public:
  /// Keeps references to all three; `terms` may grow only before the first evaluation.
  WireMechanics(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const std::vector<EnergyTerm*>& terms);

  /// An expansion with room for the longest wire.
  Expansion MakeExpansion() const;

  /// Energy, gradient and Hessian blocks with the tangent planes given by state.normals.
  void Expand(const WireState& state, Expansion& out);
  /// Makes the loads those of the model in which exactly the near points with `active` (one a near
  /// point) feel the wall. Everything else stays that of the state.
  void Model(const WireState& state, const std::vector<std::uint8_t>& active, Expansion& out) const;

  /// The same without Hessians (and without Hessian look-ups).
  void ExpandGradient(const WireState& state, Expansion& out);

  /// Repeats the joints that rest curved after state.spin changed, and nothing else.
  void ExpandCurvedJoints(const WireState& state, Expansion& out);

  /// Places the contact points of a state and finds which touch, without derivatives of anything.
  void PlacePoints(const WireState& state, bool with_hessian, PointSet& points);

  /// Takes over the wall's stiffness at every contact point. To be called after a move.
  void TakeStiffness(const WireState& state);

  /// Forgets what look-ups of former states allow to skip. Needed when the state was replaced
  /// rather than moved.
  void ForgetLookups();

  const WireModel& model() const { return model_; }
  const WallModel& wall() const { return wall_; }

 private:
  void ExpandJoints(const WireState& state, int first, Expansion& out) const;
  void ExpandTwists(const WireState& state, Expansion& out) const;
  void AddSpinLoads(const WireState& state, Expansion& out) const;
  void ExpandWall(bool with_hessian, Expansion& out) const;
  void AddLoad(int point, double length_mm, const Eigen::Vector3d& gradient,
               const Eigen::Matrix3d* hessian, Expansion& out) const;
  LoadTerms& LoadsOf(int segment, Expansion& out) const;
  template <class IsActive>
  void SumLoads(const WireState& state, IsActive is_active, Expansion& out) const;
  double SumGradient(const WireState& state, Expansion& out) const;
  void SumTrueGradient(const WireState& state, Expansion& out) const;
  void ExpandAll(const WireState& state, bool with_hessian, Expansion& out);

  const WireModel& model_;
  const ClearanceField& field_;
  const WallModel& wall_;
  const std::vector<EnergyTerm*>& terms_;
  const Frame sheath_frame_;
  double lipschitz_;

  /// The last look-up of a material point: within `free_mm` of `at`, less what the vessel has
  /// moved by, it cannot touch.
  struct Lookup {
    Eigen::Vector3d at;
    double free_mm;
  };
  std::vector<Lookup> lookups_;          ///< by PointSet::FromTip
  std::vector<double> stiffness_N_mm2_;  ///< the same; empty where it is the same everywhere
};

/// Second-order expansion of one joint; `rest` is the rest direction of `tangent`, carried by the
/// proximal segment with tangent `proximal_tangent` and normal `proximal_normal`.
/// `stiffness_mJ` = EI / (length that the joint stands for). Adds the energy to `energy_mJ`.
void ExpandJoint(BendingLaw law, double stiffness_mJ, const Eigen::Vector3d& proximal_tangent,
                 const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                 const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal, double& energy_mJ,
                 JointTerms& out);

/// The same for a joint that rests straight, with the frames given: a tenth of the work.
void ExpandStraightJoint(BendingLaw law, double stiffness_mJ,
                         const Eigen::Vector3d& proximal_tangent, const Frame& proximal_frame,
                         const Eigen::Vector3d& tangent, const Frame& frame, double& energy_mJ,
                         JointTerms& out);

/// Adds the energy `stiffness_mJ` twist_rad^2 / 2 of a twisted joint, stiffness_mJ = GJ / (length
/// that the joint stands for), to the expansion of the same joint's bending.
void AddTwist(double stiffness_mJ, double twist_rad, const Eigen::Vector3d& proximal_tangent,
              const Frame& proximal_frame, const Eigen::Vector3d& tangent, const Frame& frame,
              double& energy_mJ, JointTerms& bending, TwistTerms& out);

/// Adds what the spin of the proximal segment does to the bending of a joint that rests curved. All
/// as for ExpandJoint.
void AddSpinOfRest(BendingLaw law, double stiffness_mJ, const Eigen::Vector3d& proximal_tangent,
                   const Eigen::Vector3d& proximal_normal, const Eigen::Vector3d& rest,
                   const Eigen::Vector3d& tangent, const Frame& frame, TwistTerms& out);

/// The length of wire that joint i stands for, mm: half a segment at the sheath, which clamps the
/// wire there, and the mean of its two segments elsewhere.
inline double JointLength(const WireModel& model, const WireState& state, int joint) {
  const double lambda = model.segment_mm();
  if (joint > 1) return lambda;
  return joint == 1 ? (state.first_segment_mm + lambda) / 2 : state.first_segment_mm / 2;
}

/// EI of joint i over that length, mJ (N mm).
inline double JointStiffness(const WireModel& model, const WireState& state, int joint) {
  return model.rigidity_N_mm2(state.segments() - joint) / JointLength(model, state, joint);
}

/// GJ of joint i of a wire that twists over that length, mJ.
inline double TwistStiffness(const WireModel& model, const WireState& state, int joint) {
  return model.torsional_rigidity_N_mm2(state.segments() - joint) /
         JointLength(model, state, joint);
}

}  // namespace torquer
