// How evenly a device samples, and how soon its reports are here: measured through the daemon's own
// USB source and clock map.
#pragma once

#include <string>

namespace torquer::hil {

/// Reads the device with this serial number ("" for the only one) for so many seconds; the figures
/// as text. Throws torquer::UserError as the daemon does.
std::string TimingReport(const std::string& serial, double seconds);

}  // namespace torquer::hil
