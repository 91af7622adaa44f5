#include "calibration/motion_model.h"

#include <algorithm>
#include <cmath>

namespace torquer::calibration {

HandMotion Apply(const MotionModel& model, std::int64_t axial_counts,
                 std::int64_t transverse_counts) {
  const auto axial = static_cast<double>(axial_counts);
  const auto transverse = static_cast<double>(transverse_counts);
  const Matrix2& m = model.per_count;
  return {m[0][0] * axial + m[0][1] * transverse, m[1][0] * axial + m[1][1] * transverse};
}

MotionModel ModelOf(const MotionParameters& parameters, int cpi) {
  // Columns of counts per mm: along the push, along the turn. Its inverse has rows at right angles
  // to the other column, stretched by 1 / cos(skew).
  const double push = parameters.misalignment_rad;
  const double turn = push + parameters.skew_rad;
  const double gain = parameters.gain_mm_per_count / std::cos(parameters.skew_rad);
  MotionModel model;
  model.cpi = cpi;
  model.per_count[0] = {gain * std::cos(turn), gain * std::sin(turn)};
  // 0.0 - x rather than -x: no negative zero in files.
  model.per_count[1] = {0.0 - gain * std::sin(push) / parameters.cylinder_radius_mm,
                        gain * std::cos(push) / parameters.cylinder_radius_mm};
  return model;
}

MotionParameters ParametersOf(const MotionModel& model) {
  const Matrix2& m = model.per_count;
  MotionParameters parameters;
  parameters.misalignment_rad = std::atan2(-m[1][0], m[1][1]);
  parameters.skew_rad = std::atan2(m[0][1], m[0][0]) - parameters.misalignment_rad;
  const double stretched = std::hypot(m[0][0], m[0][1]);
  parameters.gain_mm_per_count = stretched * std::cos(parameters.skew_rad);
  parameters.cylinder_radius_mm = stretched / std::hypot(m[1][0], m[1][1]);
  return parameters;
}

double Rate(const JoystickAxis& axis, double counts) {
  const double deflection = counts - axis.center;
  const double beyond = std::abs(deflection) - axis.dead_zone;
  if (beyond <= 0.0) return 0.0;
  const double travel = deflection > 0.0 ? axis.maximum - axis.center : axis.center - axis.minimum;
  const double fraction = std::min(1.0, beyond / (travel - axis.dead_zone));
  return std::copysign(fraction * axis.full_rate_rad_per_s, deflection);
}

Calibration NominalCalibration(const std::string& device, int cpi) {
  Calibration calibration;
  calibration.device = device;
  calibration.note = "nominal: drawn dimensions, not measured";
  MotionParameters parameters;
  parameters.gain_mm_per_count = kMmPerInch / cpi;
  parameters.cylinder_radius_mm = kNominalCylinderRadiusMm;
  calibration.motion = ModelOf(parameters, cpi);
  return calibration;
}

}  // namespace torquer::calibration
