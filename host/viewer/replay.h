// A recorded session on one side, pages on the other.
#pragma once

#include <atomic>
#include <string>

#include "host/simulator/scene/scene.h"
#include "host/viewer/hash_check.h"
#include "host/viewer/recording.h"

namespace torquer::viewer {

/// Serves pages until `stop`, and prints their URL. `scene` gives the vessel's surface, and what
/// the recording of the file `log` is compared with; null: neither is done. Returns what was found.
HashCheck::Finding RunReplay(const Recording& recording, const std::string& log,
                             int listening_socket, const std::string& token, scene::Scene* scene,
                             const std::atomic<bool>& stop);

}  // namespace torquer::viewer
