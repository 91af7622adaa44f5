// A recorded session on one side, pages on the other.
#pragma once

#include <atomic>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/viewer/hash_check.h"
#include "host/viewer/recording.h"
#include "host/viewer/show_scene.h"

namespace torquer::viewer {

/// Serves pages until `stop`, and prints their URL. The recording of the file `log` is compared
/// with `scene`, whose vessel is `frames`; null: it is not, and no vessel is shown. Returns what
/// was found.
HashCheck::Finding RunReplay(const Recording& recording, const std::string& log,
                             int listening_socket, const std::string& token, SceneFrames frames,
                             scene::Scene* scene, const std::atomic<bool>& stop);

}  // namespace torquer::viewer
