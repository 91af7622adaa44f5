// Body model: a patient of analytic shapes around the vessels.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_projection.h"
#include "host/simulator/vessel/patient_axes.h"

namespace torquer::effects {

/// Part of the patient at the body's center. kTrunk: an elliptic trunk with a spine, without ends.
/// The others are heights in one patient with skull, ribs, lungs, diaphragm and pelvis.
enum class BodyRegion : std::uint8_t { kTrunk, kHead, kNeck, kArch, kHeart, kAbdomen, kPelvis };

/// Tubes of a body: bones, and the vessels of the lungs, which move with the organs.
struct BodyTubes {
  std::vector<std::vector<WirePoint>> bones;
  std::vector<std::vector<WirePoint>> lung_vessels;
};

/// Patient around the vessels.
struct Body {
  Eigen::Vector3d center_mm = Eigen::Vector3d::Zero();
  vessel::PatientAxes axes;
  BodyRegion region = BodyRegion::kTrunk;
  double width_mm = 320;  ///< from left to right; 0: no body
  double depth_mm = 220;  ///< from front to back
  double tissue_1_mm = 0.018;
  double spine_1_mm = 0.01;  ///< in excess of tissue
  /// Displacement of the organs by breath and heartbeat.
  Eigen::Vector3d organs_mm = Eigen::Vector3d::Zero();
  std::shared_ptr<const BodyTubes> tubes;  ///< of TubesOf(); null for none
};

/// The tubes of a body; null for kTrunk and without a body. The same for equal arguments.
std::shared_ptr<const BodyTubes> TubesOf(const Body& body);

/// Line integral through the body along the middle ray, without its tubes.
double MiddleIntegral(const Projection& projection, const Body& body);

/// Adds the line integrals through the body without its tubes to the plane. They are smooth, so
/// they are evaluated on a grid and interpolated. Returns the mean in the field's middle, which
/// sets the exposure.
float FillWithBody(const Projection& projection, const Body& body, Plane& plane);

/// Adds the line integrals through the tubes of the body to the plane.
void AddTubes(const Projection& projection, const Body& body, Plane& plane);

}  // namespace torquer::effects
