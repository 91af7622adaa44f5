// Session limits: the limits that a scene sets for a trainee.
#pragma once

#include <optional>
#include <string>

#include "host/simulator/scene/scene_spec.h"

namespace torquer {

/// A limit has no value if the scene lacks its effect.
struct SessionLimits {
  std::string target_centerline;           ///< centerline of the target; "" without an assessment
  std::optional<double> target_at_mm;      ///< position along this centerline
  std::optional<double> target_radius_mm;  ///< distance within which the tip reaches the target
  std::optional<double> force_limit_mN;    ///< of a patch: a success with more force is unsafe
  std::optional<double> patch_mm;          ///< length of the wire over which a wall force is taken
  std::optional<double> threshold_mN;      ///< of a patch: more force counts as a force event
};

/// The limits in a scene file, defaults included.
SessionLimits ReadLimits(const scene::SceneSpec& scene);

}  // namespace torquer
