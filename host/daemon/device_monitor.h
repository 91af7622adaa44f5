// Display of `torquer-daemon --monitor`: data of the daemon's device, before publication on the
// bus. (torquer-monitor shows messages on the bus.)
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

  /// Lines of at most `width` columns about the reports since the last call, `seconds` ago.
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
  std::optional<PipelineOutput> shown_;  // the newest at the last call
  std::int64_t reports_ = 0;
  std::int64_t missing_ = 0;  // report numbers skipped since the start
};

/// Shows the bars on standard output. On a terminal they are redrawn in place, ten times a second.
/// Elsewhere a line is printed each second. Runs in its own thread, so that a stopped terminal does
/// not stop the daemon.
class DeviceMonitor {
 public:
  DeviceMonitor();
  ~DeviceMonitor();
  DeviceMonitor(const DeviceMonitor&) = delete;
  DeviceMonitor& operator=(const DeviceMonitor&) = delete;

  /// From any thread.
  void Add(const std::string& device, const PipelineOutput& output);
  /// Prints a line of text above the bars. From any thread.
  void Print(const std::string& text);

 private:
  void Run();
  void Draw(double seconds);

  const bool terminal_;
  std::mutex mutex_;
  DeviceBars bars_;
  std::vector<std::string> printed_;
  std::size_t lines_shown_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace torquer::daemon
