// Clock map: converts device time to host time, and so gives the host time at which a report was
// sampled.
//
// A report arrives at   host = offset + rate * device + delay,   delay >= 0 and mostly small: USB
// frames, scheduling. The map is a line below all points of the last half minute. Among such lines
// it has the least sum of distances. So late reports have no influence. The method is that of Moon,
// Skelly and Towsley, "Estimation and removal of clock skew from network delay measurements", 1999.
// The smallest delay cannot be found from arrivals alone; it is taken as 0. No clock inside.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

namespace torquer::device {

class ClockMap {
 public:
  /// Starts again, for another device clock.
  void Reset();

  /// Host time at which a report was sampled. `device_us`: its device time; `host_us`: its arrival.
  /// The result is not later than `host_us`, and not earlier than that of the previous report.
  /// Device times must not decrease between resets.
  std::int64_t Map(std::int64_t device_us, std::int64_t host_us);

  /// Host seconds per device second, less 1; none in the first second, and in the first second
  /// after a restart.
  std::optional<double> drift() const;

  /// Number of jumps between the clocks (a suspended host, a stopped emulator), after which the map
  /// started again.
  std::int64_t restarts() const { return restarts_; }

 private:
  // Device time since the anchor, and the excess of the host time over it, both us.
  struct Point {
    double device = 0.0;
    double excess = 0.0;
  };

  void Begin(std::int64_t device_us, std::int64_t host_us);
  void FinishBlock();
  void Refit();

  bool begun_ = false;
  std::int64_t anchor_device_us_ = 0;
  std::int64_t anchor_host_us_ = 0;
  std::int64_t last_origin_us_ = 0;
  std::deque<Point> minima_;  // the earliest arrival of each block
  Point block_minimum_;
  double block_start_ = 0.0;  // host time since the anchor, us
  double offset_ = 0.0;       // of the line excess = offset + drift * device
  double drift_ = 0.0;
  std::int64_t restarts_ = 0;
};

}  // namespace torquer::device
