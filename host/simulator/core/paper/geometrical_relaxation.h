// Geometrical Relaxation: Baier et al. 2016, section 3.2.
//
//        near the wall                        near the wall
//   ----o====o                                   o====o----
//            mu \__o___                   __o__/ nu
//                      \__o____ ... ____o_/
//                        all free of contact
//
// Two nodes mu and nu lie near the wall, with none near it between them. The wire between them is
// bent to the curve of least energy, which may have another length. Then nodes past mu slide along
// the curve until they are lambda apart again.
//
// Equation numbers and indices are the paper's. Segment i ends at node i, so the paper's u_i is
// state.tangents[i - 1].
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

struct GeometricalSettings {
  /// A node is near the wall if its surface is closer to the wall than this, mm. The paper uses 5 %
  /// of the artery's mean diameter; the default is that of a lumen of 8 mm.
  double near_wall_mm = 0.4;
  int fewest_segments = 5;  ///< smallest number of segments of an interval
  double shrink = 0.10;     ///< ends that deviate less than this fraction of sigma are cut off
  bool second_order_slide = true;  ///< (26), (27)
};

/// Psi, (22): the part of the bending energy that depends on node i. `around` points to x_{i-2} ..
/// x_{i+2}.
double GeometricalEnergy(const Eigen::Vector3d* around);
/// Gradient of Psi with respect to x_i, (23b).
Eigen::Vector3d GeometricalGradient(const Eigen::Vector3d* around);

/// The cubic spline (28), (29) through x_mu and x_nu with unit end tangents U_mu and U_nu.
class CubicSpline {
 public:
  CubicSpline(const Eigen::Vector3d& x_mu, const Eigen::Vector3d& tangent_mu,
              const Eigen::Vector3d& x_nu, const Eigen::Vector3d& tangent_nu);
  Eigen::Vector3d At(double tau) const;  ///< tau in [0, 1]
  /// (1 + U_mu . X)^2 (1 + U_nu . X)^2 with unit X: the weight in (31). 16 for a straight line.
  double alignment() const { return alignment_; }
  /// True if neither end runs across or against X. Only then is the spline a possible shape of a
  /// wire.
  bool valid() const { return valid_; }

 private:
  Eigen::Vector3d x_mu_, x_nu_, s_mu_, s_nu_;
  double alignment_;
  bool valid_;
};

/// Nodes mu < nu between which the wire is to be relaxed.
struct GeometricalInterval {
  int mu = 0;
  int nu = 0;
  double merit = 0;  ///< chi, (31), of the interval before its ends shrank
  int length() const { return nu - mu; }
};

/// Selects the interval, 3.2.5. `near_wall` has one entry per node, nonzero if the node is near the
/// wall. Only nodes 1 .. last can be ends. Returns nullopt if the wire has no such interval.
std::optional<GeometricalInterval> SelectInterval(const WireModel& model, const WireState& state,
                                                  const std::vector<char>& near_wall, int last,
                                                  const GeometricalSettings& settings);

/// Point slide, 3.2.3. `slid` keeps curve[0 .. mu]. Every node past mu goes to a point on the
/// sphere of radius lambda about the node before it. There the curve leaves that sphere, (24),
/// (25). With `second_order` it is moved to the arc that the curve stands for, (26), (27). Past its
/// end the curve goes straight on. Both have one entry per node, curve at least two; mu >= 1.
void SlidePoints(const std::vector<Eigen::Vector3d>& curve, int mu, double lambda,
                 bool second_order, std::vector<Eigen::Vector3d>& slid);

/// Carries out GR cycles. A cycle moves the state only at its end, so it can be interrupted.
class GeometricalRelaxation {
 public:
  GeometricalRelaxation(const WireModel& model, const ClearanceField& field,
                        const GeometricalSettings& settings);

  /// Continues from the state of `twin`.
  void CopyFrom(const GeometricalRelaxation& twin);

  /// Begins a cycle: selects the interval. Returns false if there is no interval.
  bool Begin(const WireState& state);
  bool active() const { return sweeps_left_ > 0; }
  /// Cancels the cycle.
  void Interrupt() { sweeps_left_ = 0; }

  /// Performs at most `sweeps` more of the cycle's nu - mu sweeps; each updates nodes mu + 1 .. nu
  /// - 1. Returns true when the cycle has ended. The state then lies on the new curve as far as the
  /// wall allows (zeta), and its normals are untwisted. Call it only while active, on the state
  /// that Begin got.
  bool Continue(int sweeps, WireState& state);

  const GeometricalInterval& interval() const { return interval_; }  ///< interval of the last cycle
  /// Fraction of the way to the new curve in the last cycle that ended; 0 without motion.
  double zeta() const { return zeta_; }
  /// New curve, one entry per node, after the sweeps so far.
  const std::vector<Eigen::Vector3d>& curve() const { return curve_; }

 private:
  void Update(int i);
  /// Puts the fraction `zeta` of the way into slid_. Returns false if that meets the wall or moves
  /// the tip too far.
  bool Try(double zeta, const WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const GeometricalSettings settings_;
  GeometricalInterval interval_;
  int sweeps_left_ = 0;
  double zeta_ = 0;
  std::vector<char> near_wall_;
  std::vector<Eigen::Vector3d> curve_;               ///< x*
  std::vector<Eigen::Matrix<double, 3, 2>> planes_;  ///< y_i, z_i of nodes mu + 1 .. nu - 1
  std::vector<Eigen::Vector3d> blend_;
  std::vector<Eigen::Vector3d> slid_;  ///< x'
};

}  // namespace torquer
