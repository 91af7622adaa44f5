// A bench device behind a Unix socket that does what a test asks.
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
  /// Listens at `path`; answers feature requests as a healthy device does.
  explicit SocketDevice(std::string path, const std::string& serial = "SCRIPTED-1");
  ~SocketDevice();

  /// Set before a host connects.
  protocol::IdentityReport identity{};
  protocol::ConfigurationReport configuration{};
  std::atomic<bool> stalls_identity = false;  ///< refuses to give its identity
  std::atomic<bool> stalls_settings = false;  ///< refuses new settings
  /// Number of the sensor's firmware image; loading one makes it 5, if the sensor takes it.
  std::atomic<int> srom_id = 0;
  std::atomic<bool> stalls_srom = false;

  /// True once a host is connected and has asked who this is; waits for that, at most 30 s.
  bool WaitForHost();

  void Send(const protocol::InputReport& report);
  void SendBytes(std::span<const std::uint8_t> report);

  /// Hangs up; the host may connect again at once, unless `stay_away`: then after Return().
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
