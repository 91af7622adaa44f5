#include "host/device/socket_source.h"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "host/bus/clock.h"
#include "host/support/error.h"

namespace torquer::device {
namespace {

constexpr int kSocketReconnectMs = 50;
constexpr int kSocketBurst = 64;
constexpr std::int64_t kAnswerUs = 1000000;

using protocol::SocketPacket;

std::uint8_t Kind(SocketPacket kind) { return static_cast<std::uint8_t>(kind); }

}  // namespace

SocketSource::SocketSource(std::string path) : path_(std::move(path)) {
  if (path_.empty() || path_.size() >= sizeof(sockaddr_un::sun_path)) {
    throw UserError(fmt::format(
        "--socket '{}': the path of a socket has 1 to {} characters; choose a shorter one", path_,
        sizeof(sockaddr_un::sun_path) - 1));
  }
}

SocketSource::~SocketSource() { Close(); }

bool SocketSource::Connect() {
  // A device that hangs accepts no connection, so neither connect() nor send() may wait for it.
  const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return false;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path_.data(), path_.size());
  if (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
    fd_ = fd;
    return true;
  }
  const int reason = errno;
  close(fd);
  if (reason == EACCES || reason == EPROTOTYPE || reason == ENOTSOCK) {
    throw UserError(fmt::format(
        "--socket '{}': cannot be connected to: {}; give the socket at which torquer-emulator "
        "listens",
        path_, std::strerror(reason)));
  }
  return false;  // no device listens there yet
}

void SocketSource::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

void SocketSource::LetGo(const std::string& reason) {
  if (fd_ < 0 || !gone_.empty()) return;
  gone_ = reason;
  reopening_.Pause();
}

void SocketSource::Disconnect(std::int64_t host_us, const Sink& sink) {
  Close();
  waiting_.clear();
  sink({.kind = SourceEvent::Kind::kDisconnected,
        .host_us = host_us,
        .report = {},
        .text = place() + " " + std::exchange(gone_, "")});
}

void SocketSource::Wait(int timeout_ms, const Sink& sink) {
  if (fd_ < 0 && reopening_.Try([this] { return Connect(); }, sink)) {
    sink({.kind = SourceEvent::Kind::kConnected,
          .host_us = bus::MonotonicUs(),
          .report = {},
          .text = place()});
  }
  if (!gone_.empty()) Disconnect(bus::MonotonicUs(), sink);
  const auto deliver_waiting = [&] {
    while (!waiting_.empty()) {
      const Arrival arrival = std::move(waiting_.front());
      waiting_.pop_front();
      Deliver(arrival, sink);
    }
  };
  deliver_waiting();

  if (fd_ < 0) timeout_ms = std::min(timeout_ms, kSocketReconnectMs);
  std::array<pollfd, 2> events{{{wake_up_.fd(), POLLIN, 0}, {fd_, POLLIN, 0}}};
  if (poll(events.data(), events.size(), timeout_ms) <= 0) return;
  if (events[0].revents != 0) wake_up_.Clear();
  if (events[1].revents == 0) return;
  // Reads all reports that have arrived, so that a backlog needs no further polling. The number is
  // limited, because a device that sends without pause must not block the caller.
  Arrival arrival;
  for (int i = 0; i < kSocketBurst && fd_ >= 0 && Receive(arrival); ++i) {
    Deliver(arrival, sink);
    deliver_waiting();
  }
}

// One packet without waiting; false when none is there.
bool SocketSource::Receive(Arrival& arrival) {
  arrival.packet.resize(protocol::kSocketPacketMax);
  ssize_t size;
  do {
    size = recv(fd_, arrival.packet.data(), arrival.packet.size(), MSG_DONTWAIT);
  } while (size < 0 && errno == EINTR);
  if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return false;
  arrival.host_us = bus::MonotonicUs();
  arrival.packet.resize(static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  return true;
}

void SocketSource::Deliver(const Arrival& arrival, const Sink& sink) {
  if (arrival.packet.empty()) {
    gone_ = "was closed by the device";
    Disconnect(arrival.host_us, sink);
    return;
  }
  // Answers that came too late are dropped.
  if (arrival.packet[0] != Kind(SocketPacket::kInput)) return;
  sink({.kind = SourceEvent::Kind::kReport,
        .host_us = arrival.host_us,
        .report = std::span(arrival.packet).subspan(1),
        .text = {}});
}

std::vector<std::uint8_t> SocketSource::GetFeature(std::uint8_t report_id) {
  std::vector<std::uint8_t> answer =
      Request({Kind(SocketPacket::kGetFeature), report_id}, SocketPacket::kFeature);
  answer.erase(answer.begin());
  if (answer.empty() || answer[0] != report_id) {
    throw FeatureError("the device answered with another feature report than the requested one");
  }
  return answer;
}

void SocketSource::SetFeature(std::span<const std::uint8_t> report) {
  std::vector<std::uint8_t> packet(1 + report.size(), Kind(SocketPacket::kSetFeature));
  std::copy(report.begin(), report.end(), packet.begin() + 1);
  Request(packet, SocketPacket::kDone);
}

std::vector<std::uint8_t> SocketSource::Request(const std::vector<std::uint8_t>& packet,
                                                protocol::SocketPacket expected) {
  if (fd_ < 0) throw DeviceGone("no device is connected");
  if (send(fd_, packet.data(), packet.size(), MSG_NOSIGNAL) < 0) {
    if (errno == EAGAIN) throw FeatureTimeout("the device accepts no requests");
    throw DeviceGone(fmt::format("the request cannot be sent: {}", std::strerror(errno)));
  }
  const std::int64_t deadline_us = bus::MonotonicUs() + kAnswerUs;
  for (;;) {
    const std::int64_t left_us = deadline_us - bus::MonotonicUs();
    if (left_us <= 0) throw FeatureTimeout("the device did not answer within a second");
    pollfd event{fd_, POLLIN, 0};
    if (poll(&event, 1, static_cast<int>(left_us / 1000) + 1) <= 0) continue;
    Arrival arrival;
    if (!Receive(arrival)) continue;
    const bool gone = arrival.packet.empty();
    const std::uint8_t kind = gone ? 0 : arrival.packet[0];
    if (kind == Kind(expected)) return std::move(arrival.packet);
    if (kind == Kind(SocketPacket::kStall)) throw FeatureError("the device refused the request");
    waiting_.push_back(std::move(arrival));
    if (gone) throw DeviceGone("the device was disconnected");
  }
}

}  // namespace torquer::device
