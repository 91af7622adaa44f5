// The output of `torquer-daemon --list`: every device that a daemon could read, and its status.
#pragma once

#include <string>

namespace torquer::daemon {

/// A line for each bench device with its serial number, firmware, path, calibration and user. A
/// line for each mouse and joystick that this user may read. Throws UserError when the USB cannot
/// be used at all.
std::string DeviceList();

}  // namespace torquer::daemon
