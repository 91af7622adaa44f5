// Notifications to the service manager that started the daemon, by systemd's protocol. Lines are
// sent as datagrams to the socket that $NOTIFY_SOCKET names. Implemented here without libsystemd:
// the protocol is stable, and no other part of that library is needed.
#pragma once

#include <cstdint>
#include <string>

namespace torquer::daemon {

/// Sends the notifications, if a service manager requests them.
class ServiceManager {
 public:
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  /// The daemon has started: units that wait for it may start.
  void Ready();
  /// One line about its status, for `systemctl status`.
  void Status(const std::string& text);
  /// The daemon is alive at `now_us` (CLOCK_MONOTONIC). Call it often; it notifies twice in the
  /// period after which the service manager restarts a silent daemon.
  void Alive(std::int64_t now_us);
  void Stopping();

 private:
  void Send(const std::string& lines) const;

  int fd_ = -1;
  std::int64_t interval_us_ = 0;  // between notifications of Alive(); 0: none are wanted
  std::int64_t notified_us_ = 0;
};

}  // namespace torquer::daemon
