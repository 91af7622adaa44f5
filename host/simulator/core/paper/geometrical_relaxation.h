// Geometrical Relaxation: Baier et al. 2016, section 3.2.
//
//        near the wall                      near the wall      Between two nodes mu and nu that lie
//   ----o====o                                 o====o----      near the wall, with none between,
//   the
//       mu    \__o___                    __o__/    nu          wire is bent to the curve of least
//                    \__o____ ... ____o_/                      energy, whatever its length; then
//                    all
//                       free of contact                        nodes past mu slide along the curve
//                                                              until they are lambda apart again.
// Equation numbers are the paper's, and so are indices: segment i ends at node i, so the paper's
// u_i is state.tangents[i - 1].
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

struct GeometricalSettings {
  /// A node whose surface is closer to the wall than this is near it. The paper: 5 % of the mean
  /// diameter of the artery; here of a lumen of 8 mm.
  double near_wall_mm = 0.4;
  int fewest_segments = 5;         ///< an interval has at least this many
  double shrink = 0.10;            ///< ends that deviate less than this part of sigma are left out
  bool second_order_slide = true;  ///< (26), (27)
};

/// Psi, (22): what the bending energy depends on when node i moves. `around` points to x_{i-2} ..
/// x_{i+2}.
double GeometricalEnergy(const Eigen::Vector3d* around);
/// Its gradient with respect to x_i, (23b).
Eigen::Vector3d GeometricalGradient(const Eigen::Vector3d* around);

/// The cubic spline (28), (29) through x_mu and x_nu with unit end tangents U_mu and U_nu.
class CubicSpline {
 public:
  CubicSpline(const Eigen::Vector3d& x_mu, const Eigen::Vector3d& tangent_mu,
              const Eigen::Vector3d& x_nu, const Eigen::Vector3d& tangent_nu);
  Eigen::Vector3d At(double tau) const;  ///< tau in [0, 1]
  /// (1 + U_mu . X)^2 (1 + U_nu . X)^2 with unit X: the weight in (31). 16 for a straight line.
  double alignment() const { return alignment_; }
  /// Neither end runs across or against X: only then is the spline a shape of a wire.
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

/// Selects the interval, 3.2.5. `near_wall` has one entry a node, nonzero where it is near; only
/// nodes 1 .. last can be ends. None where the wire has no such interval.
std::optional<GeometricalInterval> SelectInterval(const WireModel& model, const WireState& state,
                                                  const std::vector<char>& near_wall, int last,
                                                  const GeometricalSettings& settings);

/// Point slide, 3.2.3: `slid` keeps curve[0 .. mu]; every node past mu goes where the curve leaves
/// the sphere of radius lambda about the node before it, (24), (25), moved to the arc that the
/// curve stands for, (26), (27), where `second_order`. Past its end the curve goes on straight.
/// Both have one entry a node, curve at least two; mu >= 1.
void SlidePoints(const std::vector<Eigen::Vector3d>& curve, int mu, double lambda,
                 bool second_order, std::vector<Eigen::Vector3d>& slid);

/// Carries out GR cycles. The state is moved only when a cycle ends, so one can be given up.
class GeometricalRelaxation {
 public:
  GeometricalRelaxation(const WireModel& model, const ClearanceField& field,
                        const GeometricalSettings& settings);

  /// Goes on from where `twin` stands.
  void CopyFrom(const GeometricalRelaxation& twin);

  /// Begins a cycle: selects the interval. False when there is none.
  bool Begin(const WireState& state);
  bool active() const { return sweeps_left_ > 0; }
  /// Gives the cycle up.
  void Interrupt() { sweeps_left_ = 0; }

  /// At most `sweeps` more of the cycle's nu - mu; each updates nodes mu + 1 .. nu - 1. True when
  /// the cycle has ended; the state then lies on the new curve as far as the wall lets it (zeta)
  /// and its normals are untwisted. Only while active, on the state that it began with.
  bool Continue(int sweeps, WireState& state);

  const GeometricalInterval& interval() const { return interval_; }  ///< of the last cycle
  /// Of the last cycle that ended: the part of the way to the new curve that was gone. 0: none.
  double zeta() const { return zeta_; }
  /// The new curve: one entry a node, as the sweeps have made it so far.
  const std::vector<Eigen::Vector3d>& curve() const { return curve_; }

 private:
  void Update(int i);
  /// Puts the part `zeta` of the way into slid_; false if that meets the wall or moves the tip too
  /// far.
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
