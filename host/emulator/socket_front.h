// Emulated device on a Unix socket (protocol/socket_link.h). It acts as the host's side of the USB;
// a program at the socket replaces the USB driver.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "host/emulator/usb_host.h"

namespace torquer::emulator {

class SocketFront {
 public:
  /// Listens once the device is ready, and not while it is off the bus. `host` must outlive this.
  /// Throws UserError if the path cannot be used.
  SocketFront(UsbHost& host, std::string path);
  ~SocketFront();
  SocketFront(const SocketFront&) = delete;
  SocketFront& operator=(const SocketFront&) = delete;

  /// Accepts, and takes requests; never waits. To be called once a frame.
  void Service();

  /// Waits up to `timeout_ms` for a client.
  void WaitForClient(int timeout_ms) const;

  /// Listens or not, as the device is on the bus.
  void DeviceReady();
  void DeviceGone();

  bool connected() const { return client_ >= 0; }
  /// True if there is room for another report: the client is at most two seconds behind. Otherwise
  /// the device is not polled. Like a USB host without a pending transfer, the client then loses
  /// samples, but no motion.
  bool CanSend() const;
  /// Waits up to `timeout_ms` until the client is not behind; false if it still is.
  bool WaitUntilSent(int timeout_ms);
  void Send(const std::vector<std::uint8_t>& report);

  const std::string& path() const { return path_; }

 private:
  void Listen();
  void CloseClient();
  void CloseListener();
  void Answer(std::uint8_t kind, const std::vector<std::uint8_t>& payload);
  void Flush();
  void Request(const std::vector<std::uint8_t>& packet);
  UsbHost::ControlCallback AnswerWith(std::uint8_t kind);

  UsbHost& host_;
  std::string path_;
  int listener_ = -1;
  int client_ = -1;
  std::deque<std::vector<std::uint8_t>> backlog_;  // packets that the socket has no room for
  std::uint64_t connection_ = 0;  // an answer for a former client must not reach the next
};

}  // namespace torquer::emulator
