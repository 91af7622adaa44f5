// Timing report: sampling jitter of a device and latency of its reports. Measured through the
// daemon's USB source and clock map.
#pragma once

#include <string>

namespace torquer::hil {

/// Reads the device with this serial number ("" for the only one) for `seconds`; returns the
/// figures as text. Throws torquer::UserError as the daemon does.
std::string TimingReport(const std::string& serial, double seconds);

}  // namespace torquer::hil
