// What whoever has built a device sends in: one text about the board, its sensor and its figures.
#pragma once

#include <functional>
#include <string>

namespace torquer::hil {

struct BoardReportRequest {
  std::string serial;      ///< of the device; "": the only one there is
  double seconds = 30;     ///< of reports to be read
  std::string programmer;  ///< ISP programmer on the chip, as avrdude -c names it; "": no fuses
  std::string port;        ///< its serial port, where it needs one
  /// Gets a line about what is done next, which takes a while.
  std::function<void(const std::string& line)> say = [](const std::string&) {};
};

/// Ids, self-test, fuses, rates and jitter, surface quality, the camera's picture with its verdict,
/// and the calibration that is kept for the device. What cannot be had says why in its place.
/// Throws torquer::UserError when there is no device.
std::string BoardReport(const BoardReportRequest& request);

}  // namespace torquer::hil
