// What `torquer-daemon --monitor` shows: the device that this daemon reads, count by count, before
// any of it is on the bus. (What goes on on the bus, torquer-monitor shows.)
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "host/daemon/pipeline.h"

namespace torquer::daemon {

/// Turns reports into bars. No I/O, no clock.
class DeviceBars {
 public:
  void Add(const std::string& device, const PipelineOutput& output);

  /// Lines of at most `width` columns about what was added since the last call, `seconds` ago.
  std::vector<std::string> Lines(double seconds, std::size_t width);
  /// The same in a single line.
  std::string Line(double seconds);

 private:
  struct Rates {
    double reports_per_s;
    double mm_per_s;
    double rad_per_s;
  };
  Rates Since(double seconds);

  std::string device_;
  std::optional<PipelineOutput> newest_;
  std::optional<PipelineOutput> shown_;  // the newest of the time before
  std::int64_t reports_ = 0;
  std::int64_t missing_ = 0;  // numbers skipped, all told
};

/// Shows the bars on standard output from a thread of its own, so that a terminal that has been
/// stopped does not stop the daemon: on a terminal ten times a second in place, elsewhere in a line
/// a second.
class DeviceMonitor {
 public:
  DeviceMonitor();
  ~DeviceMonitor();
  DeviceMonitor(const DeviceMonitor&) = delete;
  DeviceMonitor& operator=(const DeviceMonitor&) = delete;

  /// From any thread.
  void Add(const std::string& device, const PipelineOutput& output);
  /// A line of text above the bars. From any thread.
  void Say(const std::string& text);

 private:
  void Run();
  void Draw(double seconds);

  const bool terminal_;
  std::mutex mutex_;
  DeviceBars bars_;
  std::vector<std::string> said_;
  std::size_t lines_shown_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace torquer::daemon
