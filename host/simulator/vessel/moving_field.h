// Moving field: the field at rest, looked up at the rest position of a point.
#pragma once

#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/field_motion.h"

namespace torquer::vessel {

/// c(x, t) = c_0(x - sum of the motions' offsets): the field at rest is computed only once.
///
/// The gradient's length differs from 1 to first order in the offsets' jacobian. For a translation,
/// the field is exact.
class MovingField final : public ClearanceField {
 public:
  /// `at_rest` must outlive this.
  explicit MovingField(const ClearanceField& at_rest) : at_rest_(at_rest) {}
  /// `motion` must outlive this. Call only before the first look-up.
  void Add(FieldMotion& motion) { motions_.push_back(&motion); }

  /// Sets the time of all look-ups that follow, s since the start.
  void SetTime(double time_s);

  double Clearance(const Eigen::Vector3d& point_mm) const override;
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  double LipschitzBound() const override;
  double TravelMm() const override;
  double LastTravelMm() const override;

  /// Rest position of a point of the moved vessel, mm.
  Eigen::Vector3d AtRest(const Eigen::Vector3d& point_mm) const;
  /// Present position of a point of the vessel at rest, mm: the inverse of AtRest, within 1e-12 mm.
  /// The first guess is near_mm. One iteration from it suffices if everything around it moves
  /// alike.
  Eigen::Vector3d Moved(const Eigen::Vector3d& at_rest_mm, const Eigen::Vector3d& near_mm) const;

 private:
  Offset OffsetAt(const Eigen::Vector3d& point_mm) const;

  const ClearanceField& at_rest_;
  std::vector<FieldMotion*> motions_;
};

}  // namespace torquer::vessel
