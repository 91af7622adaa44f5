// The emulator on LCM: takes the hand's motion live, publishes the counts of its sensor, and its
// status.
#pragma once

#include <cstdint>
#include <string>

#include "host/bus/bus.h"
#include "host/bus/health_reporter.h"
#include "host/emulator/bench_device.h"
#include "host/emulator/motion_script.h"

namespace torquer::emulator {

/// Hand driven by messages, which come at irregular times. It moves to each new position in the
/// time between the last two messages, so that it does not jump.
class LiveHand {
 public:
  /// `time_s` is the emulator's own time of arrival.
  void Set(double time_s, const HandState& target);
  HandState At(double time_s) const;
  /// Place that it goes to.
  const HandState& target() const { return to_; }

 private:
  HandState from_, to_;
  double from_s_ = 0, to_s_ = 0, last_s_ = 0;
};

class LiveBus {
 public:
  /// Throws UserError where the bus cannot be reached.
  explicit LiveBus(const std::string& url);

  /// The serial number of the box, once it is known.
  void SetSerial(const std::string& serial) {
    serial_ = serial;
    health_.SetDevice(serial);
  }
  /// Takes waiting messages that are for this box, or for any, into `hand`; never waits.
  void Service(double time_s, LiveHand* hand);

  /// Numbers of reports sent since the start.
  struct Sent {
    std::int64_t wire = 0;
    std::int64_t catheter = 0;
  };
  /// Publishes the true state of the hand and of each sensor. Call it about 100 times a second and
  /// at the end.
  void PublishTruth(const BenchDevice& device, double time_s, const HandState& hand,
                    const Sent& sent);

  /// Publishes when the state has changed or a second has passed.
  void PublishHealth(const std::string& state, const std::string& message,
                     const bus::HealthCounters& counters);

  std::int64_t refused() const { return refused_ + bus_.undecodable(); }

 private:
  bus::Bus bus_;
  bus::HealthReporter health_;
  std::string serial_;
  LiveHand* hand_ = nullptr;
  double time_s_ = 0;
  std::int64_t refused_ = 0;
};

}  // namespace torquer::emulator
