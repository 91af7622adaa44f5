// Detection of several simulators on one bus, where only one may publish. No I/O, no clock.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "host/bus/sender.h"

namespace torquer::bus {

/// Remembers the simulators that publish. `now_us` is the time of the call by MonotonicUs() and
/// must not decrease.
class ActiveSimulators {
 public:
  /// Age in us after which a simulator no longer counts. Simulators publish at least five states a
  /// second.
  static constexpr std::int64_t kOldUs = 1'000'000;
  /// Most simulators remembered; one more replaces the one heard longest ago.
  static constexpr std::size_t kMost = 4;

  void State(const Sender& sender, std::int64_t now_us);
  /// Records the scene of a simulator whose states have been heard.
  void Scene(const Sender& sender, const std::string& name);
  /// A sentence naming the simulators that publish now, if there are several; otherwise "".
  std::string Conflict(std::int64_t now_us) const;

 private:
  struct Publisher {
    std::string scene;
    std::int64_t heard_us = 0;
  };
  std::map<Sender, Publisher> publishers_;
};

}  // namespace torquer::bus
