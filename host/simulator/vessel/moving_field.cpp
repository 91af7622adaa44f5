#include "host/simulator/vessel/moving_field.h"

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

double MovingField::Clearance(const Vector3d& point_mm) const {
  return at_rest_.Clearance(AtRest(point_mm));
}

void MovingField::EvaluateGradient(const Vector3d& point_mm, ClearanceSample& out) const {
  const Offset offset = OffsetAt(point_mm);
  at_rest_.EvaluateGradient(point_mm - offset.value, out);
  out.gradient -= offset.jacobian.transpose() * out.gradient;
}

void MovingField::EvaluateHessian(const Vector3d& point_mm, ClearanceSample& out) const {
  const Offset offset = OffsetAt(point_mm);
  at_rest_.EvaluateHessian(point_mm - offset.value, out);
  const Matrix3d map = Matrix3d::Identity() - offset.jacobian;
  out.hessian = map.transpose() * out.hessian * map;
  for (int k = 0; k < 3; ++k) out.hessian -= out.gradient[k] * offset.second[k];
  out.gradient = map.transpose() * out.gradient;
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

}  // namespace torquer::vessel
