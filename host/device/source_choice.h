// Command-line options of programs for the choice of a source of reports.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/device/sensor_view.h"
#include "host/support/program.h"
#include "host/support/user_paths.h"

namespace torquer::device {

/// Device selection on the command line.
struct SourceChoice {
  std::string source;                ///< "usb", "hidraw", "evdev" or "socket"; "": not given
  std::vector<std::string> devices;  ///< serial number (usb, hidraw), or device files (evdev)
  std::string socket = DefaultSocketPath();
  int sensor = 1;  ///< of the box

  bool is_mouse() const { return source == "evdev"; }
};

/// Declares --source, --device, --sensor and --socket, which set `choice`.
void AddSourceOptions(Options& options, SourceChoice& choice);

/// Source of the chosen sensor's reports. Throws UsageError when --source is missing, or what goes
/// with it is; UserError as the sources do.
std::unique_ptr<SensorView> OpenSource(const SourceChoice& choice);

}  // namespace torquer::device
