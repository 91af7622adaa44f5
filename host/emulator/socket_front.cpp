#include "host/emulator/socket_front.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>

#include "host/support/error.h"
#include "protocol/socket_link.h"

namespace torquer::emulator {
namespace {

using protocol::SocketPacket;

constexpr std::size_t kLongestBacklog = 2000;

constexpr std::uint8_t Kind(SocketPacket kind) { return static_cast<std::uint8_t>(kind); }

sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

int NewSocket() {
  const int made = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (made < 0) throw std::system_error(errno, std::generic_category(), "socket");
  return made;
}

// The socket file of a killed process stays, but no process listens on it.
bool SomebodyListens(const sockaddr_un& address) {
  const int probe = NewSocket();
  const bool listens =
      connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ||
      errno != ECONNREFUSED;
  close(probe);
  return listens;
}

}  // namespace

SocketFront::SocketFront(UsbHost& host, std::string path) : host_(host), path_(std::move(path)) {
  if (path_.empty() || path_.size() >= sizeof(sockaddr_un::sun_path)) {
    throw UserError("--socket '" + path_ + "': a socket's path has 1 to " +
                    std::to_string(sizeof(sockaddr_un::sun_path) - 1) +
                    " characters; choose a shorter one");
  }
  Listen();  // so that an unusable path is reported at once
  CloseListener();
}

SocketFront::~SocketFront() {
  CloseClient();
  CloseListener();
}

void SocketFront::Listen() {
  const sockaddr_un address = AddressOf(path_);
  struct stat status {};
  if (lstat(path_.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) {
      throw UserError("--socket '" + path_ + "': exists and is not a socket; choose another path");
    }
    if (SomebodyListens(address)) {
      throw UserError("--socket '" + path_ +
                      "': another emulator listens there; end it, or choose another path");
    }
    unlink(path_.c_str());
  }
  const int listener = NewSocket();
  if (bind(listener, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) != 0 ||
      listen(listener, 4) != 0) {
    const std::string reason = std::strerror(errno);
    close(listener);
    throw UserError("--socket '" + path_ + "': cannot listen there: " + reason +
                    "; choose a path in a directory of yours");
  }
  listener_ = listener;
}

void SocketFront::DeviceReady() {
  if (listener_ < 0) Listen();
}

void SocketFront::DeviceGone() {
  CloseListener();
  CloseClient();
}

void SocketFront::CloseClient() {
  if (client_ >= 0) close(client_);
  client_ = -1;
  backlog_.clear();
  ++connection_;
}

void SocketFront::CloseListener() {
  if (listener_ < 0) return;
  close(listener_);
  unlink(path_.c_str());
  listener_ = -1;
}

void SocketFront::Service() {
  if (listener_ >= 0) {
    const int client = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (client >= 0 && connected()) {
      close(client);  // in use, as a claimed USB interface is
    } else if (client >= 0) {
      client_ = client;
    }
  }
  Flush();
  while (connected()) {
    std::vector<std::uint8_t> packet(protocol::kSocketPacketMax);
    const ssize_t size = recv(client_, packet.data(), packet.size(), 0);
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) return;
    if (size <= 0) return CloseClient();
    packet.resize(static_cast<std::size_t>(size));
    Request(packet);
  }
}

void SocketFront::WaitForClient(int timeout_ms) const {
  pollfd event{listener_, POLLIN, 0};
  poll(&event, 1, timeout_ms);
}

void SocketFront::Request(const std::vector<std::uint8_t>& packet) {
  const std::vector<std::uint8_t> payload(packet.begin() + 1, packet.end());
  if (packet[0] == Kind(SocketPacket::kGetFeature) && payload.size() == 1) {
    host_.SubmitGetFeature(payload[0], AnswerWith(Kind(SocketPacket::kFeature)));
  } else if (packet[0] == Kind(SocketPacket::kSetFeature) && !payload.empty()) {
    host_.SubmitSetFeature(payload, AnswerWith(Kind(SocketPacket::kDone)));
  } else {
    Answer(Kind(SocketPacket::kStall), {});
  }
}

UsbHost::ControlCallback SocketFront::AnswerWith(std::uint8_t kind) {
  return [this, kind, connection = connection_](const ControlResult& result) {
    if (connection != connection_) return;
    if (result.status == TransferStatus::kDone) {
      Answer(kind, result.data);
    } else {
      Answer(Kind(SocketPacket::kStall), {});
    }
  };
}

bool SocketFront::CanSend() const { return connected() && backlog_.size() < kLongestBacklog; }

bool SocketFront::WaitUntilSent(int timeout_ms) {
  Flush();
  if (connected() && !backlog_.empty()) {
    pollfd event{client_, POLLOUT, 0};
    poll(&event, 1, timeout_ms);
    Flush();
  }
  return connected() && backlog_.empty();
}

void SocketFront::Send(const std::vector<std::uint8_t>& report) {
  Answer(Kind(SocketPacket::kInput), report);
}

void SocketFront::Answer(std::uint8_t kind, const std::vector<std::uint8_t>& payload) {
  if (!connected()) return;
  std::vector<std::uint8_t>& packet = backlog_.emplace_back(1, kind);
  packet.insert(packet.end(), payload.begin(), payload.end());
  Flush();
}

void SocketFront::Flush() {
  while (connected() && !backlog_.empty()) {
    const std::vector<std::uint8_t>& packet = backlog_.front();
    if (send(client_, packet.data(), packet.size(), MSG_NOSIGNAL) >= 0) {
      backlog_.pop_front();
    } else if (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR) {
      return;
    } else {
      CloseClient();
    }
  }
}

}  // namespace torquer::emulator
