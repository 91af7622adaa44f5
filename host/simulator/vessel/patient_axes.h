// Patient axes: the orientation of the patient.
#pragma once

#include <Eigen/Core>

namespace torquer::vessel {

/// Directions of the patient in the vessel's frame, unit and orthogonal.
struct PatientAxes {
  Eigen::Vector3d left{1, 0, 0};
  Eigen::Vector3d posterior{0, 1, 0};
  Eigen::Vector3d superior{0, 0, 1};
  bool operator==(const PatientAxes&) const = default;
};

}  // namespace torquer::vessel
