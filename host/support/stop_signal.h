// Ctrl-C, SIGTERM and a closed terminal as a request to end normally.
#pragma once

#include <atomic>

namespace torquer {

/// From now on SIGINT, SIGTERM and SIGHUP set the returned flag and do not end the program. An
/// ignored SIGHUP, as under nohup, stays ignored. The signals interrupt waiting calls.
const std::atomic<bool>& StopOnSignal();

}  // namespace torquer
