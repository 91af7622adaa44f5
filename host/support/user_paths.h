// Default paths that the programs of one user share.
#pragma once

#include <optional>
#include <string>

namespace torquer {

/// Default socket of torquer-emulator, torquer-daemon and torquer-calibrate:
/// $XDG_RUNTIME_DIR/torquer-emulator.sock, or /tmp/torquer-emulator-UID.sock without that variable.
std::string DefaultSocketPath();

/// Default path of a file about the device with this serial number: the number with `ending`
/// (".toml"). The folder is "torquer" in $XDG_CONFIG_HOME, or in ~/.config without that variable.
/// Returns nullopt if neither names a folder.
std::optional<std::string> DeviceFilePath(const std::string& serial, const std::string& ending);

}  // namespace torquer
