// Ctrl-C, SIGTERM and a closed terminal as a request to end in good order.
#pragma once

#include <atomic>

namespace torquer {

/// From now on SIGINT, SIGTERM and SIGHUP (unless it is ignored, as under nohup) end the program no
/// more, but set the flag that is returned. Calls that wait are interrupted.
const std::atomic<bool>& StopOnSignal();

}  // namespace torquer
