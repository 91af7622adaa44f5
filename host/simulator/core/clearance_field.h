// What a vessel must answer.
#pragma once

#include <Eigen/Core>

namespace torquer {

/// Clearance and its derivatives at a point of the vessel frame.
struct ClearanceSample {
  double clearance_mm = 0;                             ///< distance to the wall, > 0 in the lumen
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< d clearance / d point; about unit length
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();   ///< 1/mm; only where it was asked for
};

/// A vessel as the relaxation sees it: the signed distance to its wall as a smooth function.
///
/// Continuous with continuous gradient (a merely continuous one stalls Newton steps), defined and
/// finite for every finite point, outside the vessel too. A value is a function of the point alone:
/// never of what was asked before, so that replays are bit-exact. Safe to call from several
/// threads. Allocates nothing in the steady state (a first look-up in a region may build it).
class ClearanceField {
 public:
  ClearanceField() = default;
  ClearanceField(const ClearanceField&) = delete;
  ClearanceField& operator=(const ClearanceField&) = delete;
  virtual ~ClearanceField() = default;

  /// Value only, mm.
  virtual double Clearance(const Eigen::Vector3d& point_mm) const = 0;
  /// Value and gradient; leaves `hessian` as it was.
  virtual void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const = 0;
  /// Value, gradient and Hessian.
  virtual void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const = 0;
  /// Largest |gradient| that occurs: |c(p) - c(q)| <= bound |p - q|. Lets a caller skip look-ups.
  virtual double LipschitzBound() const = 0;
  /// For a vessel that moves: how far any place of its wall can have gone since the start, mm;
  /// never falls. A former look-up says nothing about what may have come nearer since.
  virtual double TravelMm() const { return 0; }
};

}  // namespace torquer
