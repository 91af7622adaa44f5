// Ctrl-C and SIGTERM as a request to end in good order.
#pragma once

#include <atomic>

namespace torquer {

/// From now on SIGINT and SIGTERM end the program no more, but set the flag that is returned. Calls
/// that wait are interrupted.
const std::atomic<bool>& StopOnSignal();

}  // namespace torquer
