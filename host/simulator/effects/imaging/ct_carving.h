// Carving: the scan of a vessel without the contrast agent that was in it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>

#include "host/simulator/effects/imaging/ct_volume.h"

namespace torquer::effects {

/// Value of blood without contrast agent. Soft tissue has nearly the same, so a vessel filled with
/// it leaves no trace where it has moved away.
inline constexpr double kBloodHu = 50;

/// Lumen of a vessel.
struct CtLumen {
  /// Distance to the wall, mm, positive in the lumen, nowhere steeper than `steepest`.
  std::function<double(const Eigen::Vector3d&)> clearance;
  double steepest = 1;
  Eigen::AlignedBox3d bounds_mm;
};

/// True if the boxes of a lumen and of a scan overlap.
bool Overlaps(const CtLumen& lumen, const CtVolume& volume);

/// Takes the contrast agent out of the lumen, which then holds blood. The agent is subtracted with
/// the blur of the scan, so that the tissue around stays. `blur_mm` is the standard deviation of
/// the scan's point spread, in addition to its voxels. The value of the agent may vary along the
/// vessels. It is measured in the lumen.
void CarveLumen(const CtLumen& lumen, double blur_mm, CtVolume& volume);

}  // namespace torquer::effects
