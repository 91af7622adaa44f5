// torquer-viewer: what is on the bus goes to pages, what pages want goes to the bus.
#pragma once

#include <atomic>
#include <string>

#include "host/bus/bus.h"
#include "host/viewer/case_station.h"
#include "host/viewer/show_scene.h"

namespace torquer::viewer {

/// Sources that are shown besides the bus, and who steers. One of `frames` and `station`, or none.
struct ViewerSetup {
  SceneFrames frames = {};         ///< of the scene that the simulator was given
  CaseStation* station = nullptr;  ///< starts simulators itself
  int start = -1;                  ///< case that is started at once; -1: none
  bool steer = false;              ///< pages command the instruments
};

/// Prints the page's link and serves it until `stop`.
void RunViewer(bus::Bus& bus, int listening_socket, const std::string& token,
               const ViewerSetup& setup, const std::atomic<bool>& stop);

}  // namespace torquer::viewer
