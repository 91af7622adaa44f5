// What the page shows of a scene's file, and no message on the bus has.
#pragma once

#include "host/simulator/scene/scene.h"
#include "host/viewer/page_server.h"

namespace torquer::viewer {

/// The vessel's surface, its centerlines and the target.
void ShowScene(scene::Scene& scene, PageServer& server);

}  // namespace torquer::viewer
