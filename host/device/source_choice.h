// Command-line options of programs for the choice of a source of reports.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/device/report_source.h"
#include "host/support/program.h"
#include "host/support/user_paths.h"

namespace torquer::device {

/// Device selection on the command line.
struct SourceChoice {
  std::string source;                ///< "usb", "hidraw", "evdev" or "socket"; "": not given
  std::vector<std::string> devices;  ///< serial number (usb, hidraw), or device files (evdev)
  std::string socket = DefaultSocketPath();

  bool is_mouse() const { return source == "evdev"; }
};

/// Declares --source, --device and --socket, which set `choice`.
void AddSourceOptions(Options& options, SourceChoice& choice);

/// Throws UsageError when --source is missing, or what goes with it is; UserError as the sources
/// do.
std::unique_ptr<ReportSource> OpenSource(const SourceChoice& choice);

}  // namespace torquer::device
