// Shows a recorded session on pages.
#pragma once

#include <atomic>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/viewer/hash_check.h"
#include "host/viewer/recording.h"
#include "host/viewer/show_scene.h"

namespace torquer::viewer {

/// Serves pages until `stop`, and prints their URL. Compares the recording in the file `log` with a
/// repetition in `scene`, whose vessel is `frames`. Without a scene (null) there is no comparison
/// and no vessel. Returns the result of the comparison.
HashCheck::Finding RunReplay(const Recording& recording, const std::string& log,
                             int listening_socket, const std::string& token, SceneFrames frames,
                             scene::Scene* scene, const std::atomic<bool>& stop);

}  // namespace torquer::viewer
