// The viewer's program: the bus on one side, pages on the other.
#pragma once

#include <atomic>
#include <string>

#include "host/bus/bus.h"
#include "host/simulator/scene/scene.h"

namespace torquer::viewer {

/// Serves pages until `stop`. `scene` gives the vessel's surface; null: none is shown. With `steer`
/// the page's keys command every instrument; without, nothing is sent to the simulator. Prints the
/// page's URL. Throws UserError as ListeningSocket and Bus do.
void RunViewer(bus::Bus& bus, int listening_socket, const std::string& token, scene::Scene* scene,
               bool steer, const std::atomic<bool>& stop);

}  // namespace torquer::viewer
