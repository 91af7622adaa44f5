#include "host/viewer/listening_socket.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string>

#include "host/support/error.h"

namespace torquer::viewer {
namespace {

constexpr int kFirstPassed = 3;  // SD_LISTEN_FDS_START
constexpr int kWaiting = 128;

bool Passed() {
  const char* pid = std::getenv("LISTEN_PID");
  return pid != nullptr && std::to_string(getpid()) == pid;
}

int Taken() {
  const char* count = std::getenv("LISTEN_FDS");
  if (count == nullptr || std::string(count) != "1") {
    throw UserError(fmt::format("LISTEN_FDS is {}; pass one listening socket",
                                count == nullptr ? "missing" : count));
  }
  int listens = 0;
  socklen_t size = sizeof listens;
  sockaddr_in address{};
  socklen_t length = sizeof address;
  if (getsockopt(kFirstPassed, SOL_SOCKET, SO_ACCEPTCONN, &listens, &size) != 0 || listens == 0 ||
      getsockname(kFirstPassed, reinterpret_cast<sockaddr*>(&address), &length) != 0 ||
      address.sin_family != AF_INET) {
    throw UserError(
        "file 3, passed by LISTEN_FDS, is not a listening TCP socket of IPv4; pass one");
  }
  fcntl(kFirstPassed, F_SETFD, FD_CLOEXEC);
  return kFirstPassed;
}

int Opened(std::uint16_t port) {
  const int listening = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int yes = 1;
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  if (listening < 0 || setsockopt(listening, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) != 0 ||
      bind(listening, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 ||
      listen(listening, kWaiting) != 0) {
    const std::string problem = std::strerror(errno);
    if (listening >= 0) close(listening);
    throw UserError(
        fmt::format("--port {}: cannot listen at 127.0.0.1: {}; give another, or 0 for "
                    "one that is free",
                    port, problem));
  }
  return listening;
}

}  // namespace

int ListeningSocket(std::uint16_t port) { return Passed() ? Taken() : Opened(port); }

std::uint16_t PortOf(int listening_socket) {
  sockaddr_in address{};
  socklen_t length = sizeof address;
  if (getsockname(listening_socket, reinterpret_cast<sockaddr*>(&address), &length) != 0) {
    throw UserError(fmt::format("the listening socket has no address: {}", std::strerror(errno)));
  }
  return ntohs(address.sin_port);
}

}  // namespace torquer::viewer
