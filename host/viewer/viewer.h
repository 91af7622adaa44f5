// torquer-viewer: sends messages of the bus to pages, and commands of pages to the bus.
#pragma once

#include <atomic>
#include <string>

#include "host/bus/bus.h"
#include "host/viewer/case_station.h"
#include "host/viewer/show_scene.h"

namespace torquer::viewer {

/// Sources of the page besides the bus, and its steering. At most one of `frames` and `station` is
/// set.
struct ViewerSetup {
  SceneFrames frames = {};         ///< vessel of the simulator's scene
  CaseStation* station = nullptr;  ///< starts simulators itself
  int start = -1;                  ///< case that is started at once; -1: none
  bool steer = false;              ///< pages command the instruments
};

/// Prints the page's link and serves it until `stop`.
void RunViewer(bus::Bus& bus, int listening_socket, const std::string& token,
               const ViewerSetup& setup, const std::atomic<bool>& stop);

}  // namespace torquer::viewer
