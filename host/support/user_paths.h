// Where programs of one user meet when the user names no place.
#pragma once

#include <optional>
#include <string>

namespace torquer {

/// The socket at which torquer-emulator listens and at which torquer-daemon and torquer-calibrate
/// look for it: $XDG_RUNTIME_DIR/torquer-emulator.sock, or /tmp/torquer-emulator-UID.sock without
/// that variable.
std::string DefaultSocketPath();

/// Where a file about the device with this serial number is kept unless the user says otherwise:
/// named after it, with `ending` (".toml"), in "torquer" in $XDG_CONFIG_HOME, without that variable
/// in ~/.config. Nothing where neither names a folder.
std::optional<std::string> DeviceFilePath(const std::string& serial, const std::string& ending);

}  // namespace torquer
