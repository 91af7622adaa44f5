// Health reporter: publishes the status of a process at once when it changes, otherwise once a
// second.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/bus/bus.h"

namespace torquer::bus {

/// Counters by name, in the order of publishing. One that is not known (no time measured yet) has
/// no value, and the message leaves it out.
using HealthCounters = std::vector<std::pair<std::string, std::optional<std::int64_t>>>;

class HealthReporter {
 public:
  /// `process` is "daemon", "simulator", "emulator", ..; `bus` must outlive the reporter.
  HealthReporter(Bus& bus, std::string process);

  /// Serial number of the device that the following messages are about; "" for none.
  void SetDevice(std::string device) { device_ = std::move(device); }

  /// Instrument that the following messages are about; "" for none.
  void SetInstrument(std::string instrument) { instrument_ = std::move(instrument); }

  /// Publishes the new `state` now, with the reason in a sentence.
  void Change(const std::string& state, const std::string& message, const HealthCounters& counters);

  /// True if the last message is at least a second old; counters need to be gathered only then.
  bool Due(std::int64_t now_us) const { return now_us - last_publish_us_ >= 1000000; }

  /// Publishes the present state again.
  void Repeat(const HealthCounters& counters);

  const std::string& state() const { return state_; }

 private:
  void Publish(const std::string& message, const HealthCounters& counters);

  Bus& bus_;
  std::string process_;
  std::string device_;
  std::string instrument_;
  std::string state_;
  std::int64_t last_publish_us_ = 0;
};

}  // namespace torquer::bus
