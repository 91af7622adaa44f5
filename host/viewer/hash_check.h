// Repeats a recorded session beside its replay, and compares every state.
#pragma once

#include <atomic>
#include <mutex>
#include <string>
#include <thread>

#include "host/simulator/replay.h"
#include "host/simulator/scene/scene.h"

namespace torquer::viewer {

/// Runs in a thread, as fast as possible.
class HashCheck {
 public:
  struct Finding {
    simulator::ReplayResult result;  ///< so far
    bool done = false;
    std::string error;  ///< reason for an early end; "" otherwise
  };

  /// `scene` must outlive this. Meanwhile no one else may use it.
  HashCheck(scene::Scene& scene, const std::string& log);
  /// Stops it.
  ~HashCheck();
  HashCheck(const HashCheck&) = delete;
  HashCheck& operator=(const HashCheck&) = delete;

  Finding Get() const;

 private:
  void Run(scene::Scene& scene, const std::string& log);

  mutable std::mutex mutex_;
  Finding finding_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace torquer::viewer
