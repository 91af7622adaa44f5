// Energy of a curve in a vessel, with its derivatives: bending, wall, and the loads of the effects.
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
#include <algorithm>
#include <cstddef>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/contact_points.h"
#include "host/simulator/core/curve.h"
#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/joint_terms.h"
#include "host/simulator/core/stack/stack_terms.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Second-order expansion of the wall's spring at a near point. If the point does not touch, it is
/// the expansion of a spring that also pulls.
struct WallSpring {
  double stiffness_N_mm;    ///< k times the length that the point stands for
  double penetration_mm;    ///< negative: minus the distance to contact
  double force_N;           ///< force of the spring, set by Press, >= 0
  Eigen::Matrix3d hessian;  ///< N/mm

  /// Force of the point at rest: 0 without contact, N.
  double ContactForceN() const { return penetration_mm > 0 ? stiffness_N_mm * penetration_mm : 0; }
  /// Sets the force with which the spring presses. Forces stiffen the wire, and bend the springs
  /// with the wall. The gradient stays that of the penetration.
  void Press(double pressed_N, const ClearanceSample& sample);
};

/// Sums over the points of one segment: g, t g, H, t H, t^2 H. Here g is the gradient, H the
/// Hessian, and t the distance of a point past the segment's proximal node. A load on the tangent
/// itself adds its gradient to g1 and its Hessian to h2. The sums f0 and f1 are like g0 and g1, but
/// with WallSpring::force_N for the springs.
struct LoadTerms {
  Eigen::Vector3d g0;
  Eigen::Vector3d g1;
  Eigen::Vector3d f0;
  Eigen::Vector3d f1;
  Eigen::Matrix3d h0;
  Eigen::Matrix3d h1;
  Eigen::Matrix3d h2;
};

/// Quadratic model of the energy of a curve. Buffers are allocated once; no heap after that.
struct CurveQuadraticModel {
  double energy_mJ = 0;  ///< of bending and wall
  double residual = 0;   ///< largest out-of-balance moment over the local EI/(1 mm) (torque, GJ)
  double max_penetration_mm = 0;   ///< of the curve's surface; 0 without contact
  std::vector<Frame> frames;       ///< n, one per segment
  std::vector<JointTerms> joints;  ///< n, one per joint; joint 0 has no proximal unknown
  std::vector<TwistTerms> twists;  ///< n, one per joint of a wire that twists; otherwise empty
  std::vector<TurnTerms> turns;    ///< n, for a wire that does not twist and rests curved somewhere
  std::vector<StackTerms> stack;   ///< n, for a stack that twists
  std::vector<int> load_index;     ///< n, into `loads`, -1 for a segment free of load
  std::vector<LoadTerms> loads;    ///< of the loaded segments
  /// Gradient of the contact with other curves, by displacement of a segment's distal node (3, N)
  /// and step (2, mJ). It has n entries for one of several curves, otherwise none.
  std::vector<Eigen::Matrix<double, 5, 1>> touch_gradient;
  std::vector<Eigen::Vector3d> distal_gradient;  ///< n + 1: sum of the gradients beyond node i,
                                                 ///< minus the internal force there; N
  std::vector<Eigen::Vector2d> gradient;         ///< n: d energy / d xi_i
  std::vector<double> spin_gradient;             ///< n times the model's spins: d energy / d zeta_i
  PointSet points;
  std::vector<WallSpring> springs;  ///< one for each of points.near
  PointDerivatives derivatives;     ///< of the terms, without the wall
};

/// Evaluates quadratic models of one curve. Not thread-safe.
class CurveMechanics {
 public:
  /// Keeps references to all. `stack`: the stack of several instruments that contains `curve`; null
  /// for a lone curve.
  CurveMechanics(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                 const InstrumentStack* stack, int curve);

  /// Reserves room for the longest curve. `terms`: true if energy terms act on it.
  void Reserve(bool terms, CurveQuadraticModel& out) const;
  /// Expands bending, twist and wall. The first `in_lumen_mm` lie in the lumen of another curve,
  /// away from the wall.
  void BuildModel(const Curve& curve, double in_lumen_mm, bool with_hessian,
                  CurveQuadraticModel& out);
  /// Adds the terms' loads on spins to the segments.
  void AddSpinLoads(const Curve& curve, CurveQuadraticModel& out) const;
  /// Sums the loads of the springs for which `is_active(k)` is true, and of the terms.
  template <class IsActive>
  void SumLoads(const Curve& curve, IsActive is_active, CurveQuadraticModel& out) const;
  /// Sums the loads of the touching springs, and finds gradient and residual.
  void SumTrueGradient(const Curve& curve, CurveQuadraticModel& out) const;

  ContactPoints& points() { return points_; }
  const ContactPoints& points() const { return points_; }
  const WireModel& model() const { return model_; }

 private:
  void PrepareSegments(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandBending(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandJoints(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandTurningJoints(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandTwists(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandStack(const Curve& curve, CurveQuadraticModel& out) const;
  void ExpandWall(bool with_hessian, CurveQuadraticModel& out) const;
  double SumSpins(const Curve& curve, int segment, CurveQuadraticModel& out) const;
  double SumGradient(const Curve& curve, CurveQuadraticModel& out) const;
  static LoadTerms& LoadsOf(int segment, CurveQuadraticModel& out);
  static void AddLoad(int point, double length_mm, const Eigen::Vector3d& gradient,
                      const Eigen::Vector3d& force_N, const Eigen::Matrix3d* hessian,
                      CurveQuadraticModel& out);

  const WireModel& model_;
  const WallModel& wall_;
  const Frame sheath_frame_;
  ContactPoints points_;
};

template <class IsActive>
void CurveMechanics::SumLoads(const Curve& curve, IsActive is_active,
                              CurveQuadraticModel& out) const {
  const int per_segment = out.points.per_segment;
  const bool with_hessian = out.derivatives.with_hessian;
  out.loads.clear();
  std::fill(out.load_index.begin(), out.load_index.end(), -1);
  for (std::size_t k = 0; k < out.springs.size(); ++k) {
    const WallSpring& spring = out.springs[k];
    const bool acts = is_active(k);
    // The part of forces that exist is the same for all sets of springs.
    if (!acts && !(spring.force_N > 0)) continue;
    const int q = out.points.near[k];
    const Eigen::Vector3d& inward = out.points.clearance[q].gradient;
    Eigen::Matrix3d hessian;
    if (with_hessian) {
      hessian = spring.hessian;
      if (!acts) hessian -= spring.stiffness_N_mm * inward * inward.transpose();
    }
    const double gradient_N = acts ? spring.stiffness_N_mm * spring.penetration_mm : 0;
    AddLoad(q, curve.SegmentLength(model_, q / per_segment), -gradient_N * inward,
            -spring.force_N * inward, with_hessian ? &hessian : nullptr, out);
  }
  const PointDerivatives& loads = out.derivatives;
  for (std::size_t p = 0; p < loads.used.size(); ++p) {
    if (loads.used[p] == PointDerivatives::kNothing) continue;
    const int q = static_cast<int>(p);
    const bool both = with_hessian && loads.used[p] == PointDerivatives::kBoth;
    AddLoad(q, curve.SegmentLength(model_, q / per_segment), loads.gradient[p], loads.gradient[p],
            both ? &loads.hessian[p] : nullptr, out);
  }
  for (const TangentLoad& on : loads.on_tangents) {
    LoadTerms& load = LoadsOf(on.segment, out);
    load.g1 += on.gradient;
    load.f1 += on.gradient;
    if (with_hessian) load.h2 += on.hessian;
  }
}

}  // namespace torquer
