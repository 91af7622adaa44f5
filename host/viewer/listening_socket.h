// Listening socket of the page server.
#pragma once

#include <cstdint>

namespace torquer::viewer {

/// Returns a listening TCP socket. It is file 3 if systemd's socket activation passes it
/// (LISTEN_PID and LISTEN_FDS = 1). Otherwise it is opened at `port` of 127.0.0.1; 0 takes any free
/// port. Throws UserError if the passed file is not a listening socket, or the port is in use.
int ListeningSocket(std::uint16_t port);

/// Port of a listening socket.
std::uint16_t PortOf(int listening_socket);

}  // namespace torquer::viewer
