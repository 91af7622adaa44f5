// Report from the builder of a device: one text about the board, its sensor and its figures.
#pragma once

#include <functional>
#include <string>

namespace torquer::hil {

struct BoardReportRequest {
  std::string serial;      ///< of the device; "": the only one connected
  double seconds = 30;     ///< duration for which reports are read
  std::string programmer;  ///< ISP programmer on the chip, as avrdude -c names it; "": no fuses
  std::string port;        ///< serial port of the programmer, if needed
  /// Receives a line before each step that takes a while.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
};

/// Report with ids, self-test, fuses, rates, jitter and surface quality. It also has the camera's
/// picture with its verdict, and the stored calibration. A missing part gives the reason in its
/// place. Throws torquer::UserError if there is no device.
std::string BoardReport(const BoardReportRequest& request);

}  // namespace torquer::hil
