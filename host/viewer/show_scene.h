// Scene display on the page: the vessel, its centerlines and the task.
#pragma once

#include <string>

#include "host/simulator/scene/scene.h"
#include "host/viewer/page_server.h"

namespace torquer::viewer {

/// A scene as messages for the page (page_messages.h).
struct SceneFrames {
  std::string vessel;  ///< its surface
  std::string lines;   ///< centerlines, route and target
};

/// Takes seconds if the surface is made from a field.
SceneFrames FramesOf(scene::Scene& scene);

void ShowFrames(SceneFrames frames, PageServer& server);

}  // namespace torquer::viewer
