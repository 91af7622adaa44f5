// Tells the bus how a process fares: at once when something changes, else once a second.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "host/bus/bus.h"

namespace torquer::bus {

/// Counters by name, in the order of publishing.
using HealthCounters = std::vector<std::pair<std::string, std::int64_t>>;

class HealthReporter {
 public:
  /// `process` is "daemon", "simulator", "emulator", ..; `bus` must outlive the reporter.
  HealthReporter(Bus& bus, std::string process);

  /// The serial number that following messages concern; "" for none.
  void SetDevice(std::string device) { device_ = std::move(device); }

  /// Publishes now that `state` is the state, and why, in a sentence.
  void Change(const std::string& state, const std::string& message, const HealthCounters& counters);

  /// True when the last message is a second old, so that counters need only then be gathered.
  bool Due(std::int64_t now_us) const { return now_us - last_publish_us_ >= 1000000; }

  /// Publishes the state as it stands.
  void Repeat(const HealthCounters& counters);

  const std::string& state() const { return state_; }

 private:
  void Publish(const std::string& message, const HealthCounters& counters);

  Bus& bus_;
  std::string process_;
  std::string device_;
  std::string state_;
  std::int64_t last_publish_us_ = 0;
};

}  // namespace torquer::bus
