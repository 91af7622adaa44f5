#include "tests/support/socket_device.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstring>
#include <stdexcept>

#include "protocol/socket_link.h"

namespace torquer::test {
namespace {

using protocol::SocketPacket;

std::vector<std::uint8_t> Packet(SocketPacket kind, std::span<const std::uint8_t> payload = {}) {
  std::vector<std::uint8_t> packet(1 + payload.size(), static_cast<std::uint8_t>(kind));
  std::copy(payload.begin(), payload.end(), packet.begin() + 1);
  return packet;
}

template <class Report>
std::span<const std::uint8_t> Bytes(const Report& report) {
  return {reinterpret_cast<const std::uint8_t*>(&report), sizeof report};
}

}  // namespace

SocketDevice::SocketDevice(std::string path, const std::string& serial) : path_(std::move(path)) {
  identity.report_id = protocol::kIdentityReportId;
  identity.protocol_version = protocol::kProtocolVersion;
  std::copy_n(serial.begin(), std::min(serial.size(), sizeof identity.serial), identity.serial);
  configuration.report_id = protocol::kConfigurationReportId;
  configuration.protocol_version = protocol::kProtocolVersion;
  configuration.cpi = 1200;
  Listen();
  thread_ = std::thread([this] { Serve(); });
}

SocketDevice::~SocketDevice() {
  stop_ = true;
  thread_.join();
  if (host_ >= 0) close(host_);
  if (listener_ >= 0) close(listener_);
}

void SocketDevice::Listen() {
  const int fd = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::strncpy(address.sun_path, path_.c_str(), sizeof address.sun_path - 1);
  unlink(path_.c_str());
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0 || listen(fd, 4) != 0) {
    throw std::runtime_error("cannot listen at " + path_);
  }
  listener_ = fd;
}

void SocketDevice::Serve() {
  while (!stop_) {
    std::array<pollfd, 2> events{
        {{host_ < 0 ? listener_.load() : -1, POLLIN, 0}, {host_, POLLIN, 0}}};
    if (poll(events.data(), events.size(), 5) <= 0) continue;
    const std::lock_guard lock(mutex_);
    if (events[0].revents != 0 && listener_ >= 0) {
      identified_ = false;
      host_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC);
    }
    if (events[1].revents != 0 && host_ >= 0) Answer(host_);
  }
}

void SocketDevice::Answer(int fd) {
  std::array<std::uint8_t, protocol::kSocketPacketMax> request{};
  const ssize_t size = recv(fd, request.data(), request.size(), MSG_DONTWAIT);
  if (size <= 0) {
    close(fd);
    host_ = -1;
    return;
  }
  std::vector<std::uint8_t> answer = Packet(SocketPacket::kStall);
  bool identifies = false;
  if (request[0] == static_cast<std::uint8_t>(SocketPacket::kGetFeature) && size == 2) {
    if (request[1] == protocol::kIdentityReportId && !stalls_identity) {
      answer = Packet(SocketPacket::kFeature, Bytes(identity));
      identifies = true;
    } else if (request[1] == protocol::kConfigurationReportId) {
      answer = Packet(SocketPacket::kFeature, Bytes(configuration));
    } else if (request[1] == protocol::kDiagnosticsReportId) {
      protocol::DiagnosticsReport diagnostics{};
      diagnostics.report_id = protocol::kDiagnosticsReportId;
      diagnostics.protocol_version = protocol::kProtocolVersion;
      diagnostics.srom_id = static_cast<std::uint8_t>(srom_id);
      diagnostics.sensor_fault_cause = stalls_srom ? protocol::kSensorSromRefused : 0;
      answer = Packet(SocketPacket::kFeature, Bytes(diagnostics));
    }
  } else if (request[0] == static_cast<std::uint8_t>(SocketPacket::kSetFeature) &&
             size == 1 + sizeof(protocol::SromReport)) {
    if (!stalls_srom) {
      srom_id = 5;
      answer = Packet(SocketPacket::kDone);
    }
  } else if (request[0] == static_cast<std::uint8_t>(SocketPacket::kSetFeature) &&
             size == 1 + sizeof configuration && !stalls_settings) {
    std::memcpy(&configuration, request.data() + 1, sizeof configuration);
    answer = Packet(SocketPacket::kDone);
  }
  send(fd, answer.data(), answer.size(), MSG_NOSIGNAL);
  if (identifies) identified_ = true;
}

bool SocketDevice::WaitForHost() {
  for (int i = 0; i < 6000 && !identified_; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return identified_;
}

void SocketDevice::Send(const protocol::InputReport& report) { SendBytes(Bytes(report)); }

void SocketDevice::SendBytes(std::span<const std::uint8_t> report) {
  const std::vector<std::uint8_t> packet = Packet(SocketPacket::kInput, report);
  const std::lock_guard lock(mutex_);
  if (host_ >= 0) send(host_, packet.data(), packet.size(), MSG_NOSIGNAL);
}

void SocketDevice::Unplug(bool stay_away) {
  const std::lock_guard lock(mutex_);
  identified_ = false;
  if (stay_away) {
    close(listener_);
    listener_ = -1;
    unlink(path_.c_str());
  }
  close(host_);
  host_ = -1;
}

void SocketDevice::Return() {
  const std::lock_guard lock(mutex_);
  Listen();
}

}  // namespace torquer::test
