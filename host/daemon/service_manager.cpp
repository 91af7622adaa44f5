#include "host/daemon/service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstddef>
#include <cstdlib>
#include <cstring>

namespace torquer::daemon {

ServiceManager::ServiceManager() {
  const char* name = std::getenv("NOTIFY_SOCKET");
  if (name == nullptr || (*name != '/' && *name != '@')) return;
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::size_t length = std::strlen(name);
  if (length >= sizeof address.sun_path) return;
  std::memcpy(address.sun_path, name, length);
  if (*name == '@') address.sun_path[0] = '\0';  // in the abstract namespace
  fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + length);
  if (fd_ >= 0 && connect(fd_, reinterpret_cast<const sockaddr*>(&address), size) != 0) {
    close(fd_);
    fd_ = -1;
  }
  const char* period_us = std::getenv("WATCHDOG_USEC");
  const char* process = std::getenv("WATCHDOG_PID");
  const bool meant = process == nullptr || std::strtol(process, nullptr, 10) == getpid();
  if (period_us != nullptr && meant) interval_us_ = std::strtoll(period_us, nullptr, 10) / 2;
}

ServiceManager::~ServiceManager() {
  if (fd_ >= 0) close(fd_);
}

void ServiceManager::Ready() { Send("READY=1"); }

void ServiceManager::Status(const std::string& text) {
  Send("STATUS=" + text.substr(0, text.find('\n')));
}

void ServiceManager::Alive(std::int64_t now_us) {
  if (interval_us_ <= 0 || now_us - notified_us_ < interval_us_) return;
  notified_us_ = now_us;
  Send("WATCHDOG=1");
}

void ServiceManager::Stopping() { Send("STOPPING=1"); }

// Errors are ignored: the daemon keeps running if the service manager does not listen.
void ServiceManager::Send(const std::string& lines) const {
  if (fd_ >= 0) static_cast<void>(send(fd_, lines.data(), lines.size(), MSG_NOSIGNAL));
}

}  // namespace torquer::daemon
