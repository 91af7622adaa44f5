// A vessel that moves, as a field: the field at rest, looked up where a point came from.
#pragma once

#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/field_motion.h"

namespace torquer::vessel {

/// c(x, t) = c_0(x - sum of the motions' offsets), so a field that was computed once serves.
///
/// The gradient's length is 1 to first order of the offsets' jacobian; where the offset is a
/// translation all stays exact.
class MovingField final : public ClearanceField {
 public:
  /// `at_rest` must outlive this.
  explicit MovingField(const ClearanceField& at_rest) : at_rest_(at_rest) {}
  /// `motion` must outlive this. Before the first look-up.
  void Add(FieldMotion& motion) { motions_.push_back(&motion); }

  /// The time of all look-ups that follow, s since the start.
  void SetTime(double time_s);

  double Clearance(const Eigen::Vector3d& point_mm) const override;
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  double LipschitzBound() const override;
  double TravelMm() const override;

  /// Where a point of the moved vessel was at rest.
  Eigen::Vector3d AtRest(const Eigen::Vector3d& point_mm) const;
  /// Where a point of the vessel at rest is now: the inverse of AtRest, within 1e-12 mm. `near_mm`
  /// is where it may be; exact there after one look where all about it moves alike.
  Eigen::Vector3d Moved(const Eigen::Vector3d& at_rest_mm, const Eigen::Vector3d& near_mm) const;

 private:
  Offset OffsetAt(const Eigen::Vector3d& point_mm) const;

  const ClearanceField& at_rest_;
  std::vector<FieldMotion*> motions_;
};

}  // namespace torquer::vessel
