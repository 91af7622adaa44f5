// Reports over a Unix socket (protocol/socket_link.h), from the emulator, byte for byte as on USB.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "host/device/reopening.h"
#include "host/device/report_source.h"
#include "host/device/wake_up.h"
#include "protocol/socket_link.h"

namespace torquer::device {

class SocketSource : public ReportSource {
 public:
  /// The device listens at `path`, perhaps later.
  /// Throws UserError when `path` is empty or too long for a socket.
  explicit SocketSource(std::string path);
  ~SocketSource() override;

  void Wait(int timeout_ms, const Sink& sink) override;
  void LetGo(const std::string& reason) override;
  void Interrupt() override { wake_up_.Raise(); }
  std::vector<std::uint8_t> GetFeature(std::uint8_t report_id) override;
  void SetFeature(std::span<const std::uint8_t> report) override;
  std::string place() const override { return "socket " + path_; }

 private:
  struct Arrival {
    std::int64_t host_us;
    std::vector<std::uint8_t> packet;  // kind byte first; empty: the other end was closed
  };

  bool Connect();
  void Close();
  void Disconnect(std::int64_t host_us, const Sink& sink);
  bool Receive(Arrival& arrival);
  void Deliver(const Arrival& arrival, const Sink& sink);
  std::vector<std::uint8_t> Request(const std::vector<std::uint8_t>& packet,
                                    protocol::SocketPacket expected);

  std::string path_;
  int fd_ = -1;
  WakeUp wake_up_;
  Reopening reopening_;
  std::string gone_;             // why, once the device is
  std::deque<Arrival> waiting_;  // arrived during a Request()
};

}  // namespace torquer::device
