// Where programs of one user meet when the user names no place.
#pragma once

#include <string>

namespace torquer {

/// The socket at which torquer-emulator listens and at which torquer-daemon and torquer-calibrate
/// look for it: $XDG_RUNTIME_DIR/torquer-emulator.sock, or /tmp/torquer-emulator-UID.sock without
/// that variable.
std::string DefaultSocketPath();

}  // namespace torquer
