// What a trainee is held to: the limits that a scene sets.
#pragma once

#include <optional>
#include <string>

#include "host/simulator/scene/scene_spec.h"

namespace torquer {

/// Nothing where the scene has no such effect.
struct SessionLimits {
  std::string target_centerline;           ///< on which the target lies; "" without an assessment
  std::optional<double> target_at_mm;      ///< where on it
  std::optional<double> target_radius_mm;  ///< reached when the tip is this near
  std::optional<double> force_limit_mN;    ///< of a patch: above it a success is unsafe
  std::optional<double> patch_mm;          ///< length of the wire over which a wall force is taken
  std::optional<double> threshold_mN;      ///< of a patch: above it an event of force is counted
};

/// The limits in a scene file, defaults included.
SessionLimits ReadLimits(const scene::SceneSpec& scene);

}  // namespace torquer
