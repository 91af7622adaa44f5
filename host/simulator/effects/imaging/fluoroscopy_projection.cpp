#include "host/simulator/effects/imaging/fluoroscopy_projection.h"

#include <cmath>

namespace torquer::effects {

Projection::Projection(const CArm& arm, double lao_rad, double cra_rad) {
  const Eigen::Vector3d anterior = -arm.axes.posterior;
  const Eigen::Vector3d turned = std::cos(lao_rad) * anterior + std::sin(lao_rad) * arm.axes.left;
  const Eigen::Vector3d right = std::cos(lao_rad) * arm.axes.left - std::sin(lao_rad) * anterior;
  const Eigen::Vector3d beam = std::cos(cra_rad) * turned + std::sin(cra_rad) * arm.axes.superior;
  const Eigen::Vector3d up = std::cos(cra_rad) * arm.axes.superior - std::sin(cra_rad) * turned;
  camera_.row(0) = right;
  camera_.row(1) = up;
  camera_.row(2) = beam;
  source_mm_ = arm.isocenter_mm - arm.sod_mm * beam;
  pixels_ = arm.sid_mm / arm.pixel_mm();
  middle_column_ = (arm.width - 1) / 2.0;
  middle_row_ = (arm.height - 1) / 2.0;
}

}  // namespace torquer::effects
