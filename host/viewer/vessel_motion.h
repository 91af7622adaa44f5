// Motion of a vessel for the page: displacement of each point in each motion.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/effects/motion/periodic_motion.h"
#include "host/simulator/scene/scene.h"

namespace torquer::viewer {

/// The m motions of a vessel.
using Motions = std::vector<const effects::PeriodicMotion*>;

/// Motions of a scene; empty if its vessel rests.
Motions MotionsOf(const scene::Scene& scene);

/// Shares of a motion's displacement at points at rest: 2^m per point, one for each corner. At a
/// corner each motion is at its beginning (bit 0) or its end (bit 1). The lowest bit is the first
/// motion. Between corners the share is multilinear. It is exact at the corners, where the heart
/// rests and the breath is held. It is nearly exact while only one motion is active.
using Shares = std::vector<float>;

/// Shares of each motion at `points_mm`.
std::vector<Shares> SharesOf(const Motions& motions, const std::vector<Eigen::Vector3d>& points_mm);

/// Position of a point for the phases `pulses` of the motions, 0 to 1 each. `point`: its number in
/// `shares`.
Eigen::Vector3d Moved(const Eigen::Vector3d& at_rest_mm, const Motions& motions,
                      const std::vector<Shares>& shares, std::size_t point,
                      const std::vector<double>& pulses);

}  // namespace torquer::viewer
