// Which simulators publish on a bus: there may be one. No I/O, no clock.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "host/bus/sender.h"

namespace torquer::bus {

/// `now_us` is the time of the call, by MonotonicUs(), ascending.
class SimulatorsHeard {
 public:
  /// A simulator publishes a state five times a second at least.
  static constexpr std::int64_t kOldUs = 1'000'000;
  /// One more takes the place of the one that was heard longest ago.
  static constexpr std::size_t kMost = 4;

  void State(const Sender& sender, std::int64_t now_us);
  /// The scene of one whose states are heard.
  void Scene(const Sender& sender, const std::string& name);
  /// Names those that publish now, where they are more than one; "" otherwise.
  std::string Conflict(std::int64_t now_us) const;

 private:
  struct Heard {
    std::string scene;
    std::int64_t heard_us = 0;
  };
  std::map<Sender, Heard> heard_;
};

}  // namespace torquer::bus
