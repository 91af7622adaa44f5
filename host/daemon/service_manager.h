// What a daemon tells the service manager that started it, by systemd's notification protocol: one
// datagram of lines to the socket named in $NOTIFY_SOCKET. Written out here rather than taken from
// libsystemd: the protocol is promised to stay, and this is all of it that is needed.
#pragma once

#include <cstdint>
#include <string>

namespace torquer::daemon {

/// Does nothing where no service manager asked to be told.
class ServiceManager {
 public:
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  /// The daemon is up: units that wait for it may start.
  void Ready();
  /// One line about what it does, for `systemctl status`.
  void Status(const std::string& text);
  /// The daemon is alive at `now_us` (CLOCK_MONOTONIC): to be called often; tells it twice in each
  /// period after which the service manager, having heard nothing, would kill and restart it.
  void Alive(std::int64_t now_us);
  void Stopping();

 private:
  void Send(const std::string& lines) const;

  int fd_ = -1;
  std::int64_t interval_us_ = 0;  // of Alive(); 0: nobody wants to know
  std::int64_t told_us_ = 0;
};

}  // namespace torquer::daemon
