// Clearance field: the interface of a vessel to the relaxation.
#pragma once

#include <Eigen/Core>

namespace torquer {

/// Clearance and its derivatives at a point of the vessel frame.
struct ClearanceSample {
  double clearance_mm = 0;                             ///< distance to the wall, > 0 in the lumen
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< d clearance / d point; about unit length
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();   ///< 1/mm; only from EvaluateHessian
};

/// Signed distance to the vessel wall as a smooth function, as the relaxation uses it.
///
/// The value and its gradient are continuous: a discontinuous gradient stalls Newton steps. Both
/// are finite at every finite point, also outside the vessel. A value depends on the point alone,
/// never on earlier look-ups, so replays are bit-exact. Thread-safe. Allocates nothing in the
/// steady state; a first look-up in a region may build it.
class ClearanceField {
 public:
  ClearanceField() = default;
  ClearanceField(const ClearanceField&) = delete;
  ClearanceField& operator=(const ClearanceField&) = delete;
  virtual ~ClearanceField() = default;

  /// Value only, mm.
  virtual double Clearance(const Eigen::Vector3d& point_mm) const = 0;
  /// Value and gradient; does not write `hessian`.
  virtual void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const = 0;
  /// Value, gradient and Hessian.
  virtual void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const = 0;
  /// Largest |gradient| that occurs: |c(p) - c(q)| <= bound |p - q|. Callers use it to skip
  /// look-ups.
  virtual double LipschitzBound() const = 0;
  /// For a moving vessel: upper bound of the distance that any wall point has moved since the
  /// start, mm. Never decreases. An earlier look-up does not bound wall motion after it.
  virtual double TravelMm() const { return 0; }
  /// Part of TravelMm() that the last motion added, mm. Exact, unlike a difference of two travels.
  virtual double LastTravelMm() const { return 0; }
};

}  // namespace torquer
