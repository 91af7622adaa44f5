#include "host/emulator/usbip_front.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <span>
#include <string>
#include <utility>

#include "host/emulator/usbip_commands.h"
#include "protocol/usb_ids.h"

namespace torquer::emulator {
namespace {

// Longest wait of a frame for the next input transfer. A busy machine delays a kernel less; a
// killed program is not waited for.
constexpr std::int64_t kLongestHoldMs = 20000;

std::int64_t NowMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::uint16_t LittleEndian(const std::array<std::uint8_t, 8>& setup, std::size_t at) {
  return static_cast<std::uint16_t>(setup[at] | (setup[at + 1] << 8));
}

}  // namespace

UsbipFront::UsbipFront(UsbHost& host, std::uint16_t port)
    : host_(host), port_(port), listener_(ListenOnLoopback("--port", port_)) {
  host_.wants_input = [this] { return !inputs_.empty(); };
  host_.on_input = [this](const std::vector<std::uint8_t>& report) { EndInput(0, report); };
  host_.on_input_stall = [this] { EndInput(-EPIPE, {}); };
  // The kernel learns of an unplugged device by the end of its connection.
  host_.on_gone = [this] { Disconnect(); };
}

UsbipFront::~UsbipFront() {
  host_.wants_input = [] { return false; };
  host_.on_input = nullptr;
  host_.on_input_stall = nullptr;
  host_.on_gone = nullptr;
  Disconnect();
  close(listener_);
}

void UsbipFront::Disconnect() {
  if (client_ >= 0) close(client_);
  client_ = -1;
  imported_ = false;
  last_reply_ = false;
  streaming_ = false;
  received_.clear();
  to_send_.clear();
  inputs_.clear();
  controls_.clear();
  ++connection_;
}

void UsbipFront::Wait(int timeout_ms) const {
  std::array<pollfd, 2> events{{{listener_, POLLIN, 0}, {client_, POLLIN, 0}}};
  poll(events.data(), client_ >= 0 ? 2 : 1, timeout_ms);
}

bool UsbipFront::HoldsFrame() const {
  return streaming_ && inputs_.empty() && controls_.empty() &&
         NowMs() - input_ended_ms_ < kLongestHoldMs;
}

void UsbipFront::Service() {
  // One kernel at a time: another waits until the first is gone.
  if (client_ < 0) {
    client_ = accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    const int yes = 1;
    if (client_ >= 0) setsockopt(client_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
  }
  Read();
  while (client_ >= 0 && (imported_ ? TakeTransfer() : TakeOperation())) {
  }
  Flush();
  if (last_reply_ && to_send_.empty()) Disconnect();
}

void UsbipFront::Read() {
  std::array<std::uint8_t, 4096> bytes{};
  while (client_ >= 0) {
    const ssize_t size = recv(client_, bytes.data(), bytes.size(), 0);
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
    if (size < 0 && errno == EINTR) continue;
    if (size <= 0) return Disconnect();
    received_.insert(received_.end(), bytes.begin(), bytes.begin() + size);
  }
}

void UsbipFront::Flush() {
  while (client_ >= 0 && !to_send_.empty()) {
    const ssize_t size = send(client_, to_send_.data(), to_send_.size(), MSG_NOSIGNAL);
    if (size < 0 && errno == EINTR) continue;
    if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return;
    if (size <= 0) return Disconnect();
    to_send_.erase(to_send_.begin(), to_send_.begin() + size);
  }
}

// False when more bytes are needed first.
bool UsbipFront::TakeOperation() {
  if (last_reply_ || received_.size() < usbip::kOperationBytes) return false;
  const auto code = static_cast<std::uint16_t>(usbip::U32At(received_, 0));
  const Enumeration& device = host_.enumeration();
  if (code == usbip::kRequestDevices) {
    usbip::AppendOperation(to_send_, usbip::kReplyDevices, 0);
    usbip::AppendU32(to_send_, host_.ready() ? 1 : 0);
    if (host_.ready()) {
      usbip::AppendDevice(to_send_, kBusId, device.device_descriptor,
                          device.configuration_descriptor);
      // Its one interface: class, subclass, protocol, padding.
      const auto& bytes = device.configuration_descriptor;
      to_send_.insert(to_send_.end(), {bytes[14], bytes[15], bytes[16], 0});
    }
    last_reply_ = true;
    return false;
  }
  if (code != usbip::kRequestImport) {
    Disconnect();
    return false;
  }
  if (received_.size() < usbip::kOperationBytes + usbip::kBusIdBytes) return false;
  const char* asked = reinterpret_cast<const char*>(received_.data()) + usbip::kOperationBytes;
  const bool ours = std::string(asked, strnlen(asked, usbip::kBusIdBytes)) == kBusId;
  received_.erase(received_.begin(),
                  received_.begin() + usbip::kOperationBytes + usbip::kBusIdBytes);
  imported_ = ours && host_.ready();
  usbip::AppendOperation(to_send_, usbip::kReplyImport, imported_ ? 0 : 1);
  if (imported_) {
    usbip::AppendDevice(to_send_, kBusId, device.device_descriptor,
                        device.configuration_descriptor);
  } else {
    last_reply_ = true;
  }
  return imported_;
}

bool UsbipFront::TakeTransfer() {
  if (received_.size() < usbip::kTransferBytes) return false;
  const usbip::Transfer transfer = usbip::ParseTransfer(received_);
  const bool submits = transfer.command == usbip::kSubmit;
  if ((!submits && transfer.command != usbip::kUnlink) || transfer.length > usbip::kLongestData) {
    Disconnect();
    return false;
  }
  const std::size_t data = submits && !transfer.to_host ? transfer.length : 0;
  if (received_.size() < usbip::kTransferBytes + data) return false;
  const auto begin = received_.begin() + usbip::kTransferBytes;
  const auto end = begin + static_cast<std::ptrdiff_t>(data);
  std::vector<std::uint8_t> bytes(begin, end);
  received_.erase(received_.begin(), end);
  if (submits) {
    StartTransfer(transfer, std::move(bytes));
  } else {
    Unlink(transfer);
  }
  return client_ >= 0;
}

void UsbipFront::StartTransfer(const usbip::Transfer& transfer, std::vector<std::uint8_t> data) {
  const std::uint32_t sequence = transfer.sequence;
  if (transfer.endpoint == protocol::kInputEndpoint && transfer.to_host) {
    inputs_.push_back({sequence, transfer.length});
    streaming_ = true;
    return;
  }
  if (transfer.endpoint != 0) {
    usbip::AppendReturnSubmit(to_send_, sequence, -EPIPE, 0, {});  // there is no such endpoint
    return;
  }
  const SetupPacket setup{transfer.setup[0], transfer.setup[1], LittleEndian(transfer.setup, 2),
                          LittleEndian(transfer.setup, 4), LittleEndian(transfer.setup, 6)};
  controls_.insert(sequence);
  host_.Submit(setup, std::move(data),
               [this, sequence, setup, connection = connection_](const ControlResult& result) {
                 if (connection != connection_ || controls_.erase(sequence) == 0) return;
                 const std::size_t passed =
                     setup.type & 0x80 ? std::min<std::size_t>(result.data.size(), setup.length)
                                       : setup.length;
                 const bool done = result.status == TransferStatus::kDone;
                 const std::span<const std::uint8_t> bytes(result.data);
                 usbip::AppendReturnSubmit(
                     to_send_, sequence, StatusOf(result.status),
                     done ? static_cast<std::uint32_t>(passed) : 0,
                     done ? bytes.first(std::min(bytes.size(), passed)) : bytes.first(0));
               });
}

void UsbipFront::Unlink(const usbip::Transfer& transfer) {
  const auto input = std::find_if(inputs_.begin(), inputs_.end(), [&](const Input& pending) {
    return pending.sequence == transfer.victim;
  });
  bool found = controls_.erase(transfer.victim) != 0;
  if (input != inputs_.end()) {
    inputs_.erase(input);
    found = true;
    if (inputs_.empty()) streaming_ = false;  // the program lets go of the device
  }
  // A transfer that has ended by itself was returned earlier.
  usbip::AppendReturnUnlink(to_send_, transfer.sequence, found ? -ECONNRESET : 0);
}

void UsbipFront::EndInput(std::int32_t status, const std::vector<std::uint8_t>& report) {
  const Input input = inputs_.front();
  inputs_.pop_front();
  input_ended_ms_ = NowMs();
  // A report larger than its buffer causes an overflow, as on the wire.
  const bool fits = report.size() <= input.length;
  const std::span<const std::uint8_t> bytes(report);
  usbip::AppendReturnSubmit(to_send_, input.sequence, fits ? status : -EOVERFLOW,
                            fits ? static_cast<std::uint32_t>(report.size()) : 0,
                            fits ? bytes : bytes.first(0));
  if (status == 0 && fits) ++inputs_delivered_;
  Flush();
}

}  // namespace torquer::emulator
