#include "host/simulator/vessel/moving_field.h"

#include <Eigen/LU>

namespace torquer::vessel {

using Eigen::Matrix3d;
using Eigen::Vector3d;

void MovingField::SetTime(double time_s) {
  for (FieldMotion* motion : motions_) motion->SetTime(time_s);
}

Offset MovingField::OffsetAt(const Vector3d& point_mm) const {
  Offset offset;
  for (const FieldMotion* motion : motions_) motion->AddOffset(point_mm, offset);
  return offset;
}

Vector3d MovingField::AtRest(const Vector3d& point_mm) const {
  return point_mm - OffsetAt(point_mm).value;
}

Vector3d MovingField::Moved(const Vector3d& at_rest_mm, const Vector3d& near_mm) const {
  // Newton's method on x - offset(x) = at_rest_mm; the motions do not fold, so one solution exists.
  Vector3d at = near_mm;
  for (int k = 0; k < 30; ++k) {
    const Offset offset = OffsetAt(at);
    const Vector3d miss = at - offset.value - at_rest_mm;
    if (miss.squaredNorm() < 1e-24) break;
    if (k < 10) {
      at -= (Matrix3d::Identity() - offset.jacobian).inverse() * miss;
    } else {
      at -= miss;  // slower, but converges: the jacobian's norm is below 1
    }
  }
  return at;
}

double MovingField::Clearance(const Vector3d& point_mm) const {
  return at_rest_.Clearance(AtRest(point_mm));
}

void MovingField::EvaluateGradient(const Vector3d& point_mm, ClearanceSample& out) const {
  const Offset offset = OffsetAt(point_mm);
  at_rest_.EvaluateGradient(point_mm - offset.value, out);
  if (offset.rigid) return;
  out.gradient -= offset.jacobian.transpose() * out.gradient;
}

void MovingField::EvaluateHessian(const Vector3d& point_mm, ClearanceSample& out) const {
  const Offset offset = OffsetAt(point_mm);
  at_rest_.EvaluateHessian(point_mm - offset.value, out);
  if (offset.rigid) return;
  const Matrix3d map = Matrix3d::Identity() - offset.jacobian;
  out.hessian = map.transpose() * out.hessian * map;
  for (int k = 0; k < 3; ++k) out.hessian -= out.gradient[k] * offset.second[k];
  out.gradient -= offset.jacobian.transpose() * out.gradient;
}

double MovingField::LipschitzBound() const {
  double stretch = 1;
  for (const FieldMotion* motion : motions_) stretch += motion->LargestStretch();
  return stretch * at_rest_.LipschitzBound();
}

double MovingField::TravelMm() const {
  double travel_mm = 0;
  for (const FieldMotion* motion : motions_) travel_mm += motion->TravelMm();
  return travel_mm * at_rest_.LipschitzBound();
}

double MovingField::LastTravelMm() const {
  double travel_mm = 0;
  for (const FieldMotion* motion : motions_) travel_mm += motion->LastTravelMm();
  return travel_mm * at_rest_.LipschitzBound();
}

}  // namespace torquer::vessel
