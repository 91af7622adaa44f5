// The socket at which the page is served.
#pragma once

#include <cstdint>

namespace torquer::viewer {

/// A TCP socket that listens. Passed in by systemd's socket-activation convention (LISTEN_PID and
/// LISTEN_FDS = 1, file 3), else opened at `port` of 127.0.0.1; 0 takes any free port.
/// Throws UserError if the passed file is no listening socket, or the port is in use.
int ListeningSocket(std::uint16_t port);

/// The port at which it listens.
std::uint16_t PortOf(int listening_socket);

}  // namespace torquer::viewer
