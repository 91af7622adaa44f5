// Value of a key in a scene, by the key's full name.
#pragma once

#include <string>
#include <vector>

#include "host/simulator/scene/scene_spec.h"

namespace torquer::scene {

/// Numbers that a key has in the scene, in the instrument's device, or by default; one for a plain
/// number. `key`: full name, as TomlValues takes it. Throws UserError if the scene has another
/// value for it, or no table of the key.
std::vector<double> NumbersOf(const SceneSpec& spec, const std::string& key);

}  // namespace torquer::scene
