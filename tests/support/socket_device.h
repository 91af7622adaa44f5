// Scripted bench device behind a Unix socket.
#pragma once

#include <atomic>
#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "protocol/hid_reports.h"

namespace torquer::test {

class SocketDevice {
 public:
  /// Listens at `path`; answers feature requests like a healthy device.
  explicit SocketDevice(std::string path, const std::string& serial = "SCRIPTED-1");
  ~SocketDevice();

  /// Identity; must be set before a host connects.
  protocol::IdentityReport identity{};
  protocol::ConfigurationReport configuration{};
  std::atomic<bool> stalls_identity = false;  ///< refuses identity requests
  std::atomic<bool> stalls_settings = false;  ///< refuses new settings
  /// Number of the sensor's firmware image; a successful load sets it to 5.
  std::atomic<int> srom_id = 0;
  std::atomic<bool> stalls_srom = false;

  /// Waits at most 30 s; true once a host is connected and has requested the identity.
  bool WaitForHost();

  void Send(const protocol::InputReport& report);
  void SendBytes(std::span<const std::uint8_t> report);

  /// Disconnects. The host may reconnect at once, or with `stay_away` only after Return().
  void Unplug(bool stay_away = false);
  void Return();

 private:
  void Serve();
  void Listen();
  void Answer(int fd);

  std::string path_;
  std::atomic<int> listener_ = -1;
  std::atomic<int> host_ = -1;
  std::atomic<bool> identified_ = false;
  std::atomic<bool> stop_ = false;
  std::mutex mutex_;
  std::thread thread_;
};

}  // namespace torquer::test
