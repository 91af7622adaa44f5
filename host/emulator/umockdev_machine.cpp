#include "host/emulator/umockdev_machine.h"

#include <dlfcn.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>

// libumockdev lists the sockets of all programs that watch for devices, connects to one after
// another, and sends. It skips a program that has ended before connect() (ECONNREFUSED). It aborts
// if the socket's file is missing too, or if the program ends between connect() and sendmsg(). A
// program that ends when its cable is pulled causes both cases. It aborts too if a program has not
// read the events before, and its socket has no room (EAGAIN). The kernel then drops the event. So
// both calls are intercepted here, and return a result that libumockdev handles.

namespace {

std::atomic<bool> has_machine = false;

bool IsLocal(int socket) {
  int domain = 0;
  socklen_t size = sizeof(domain);
  return getsockopt(socket, SOL_SOCKET, SO_DOMAIN, &domain, &size) == 0 && domain == AF_UNIX;
}

// The function that would be called if there were none here.
template <class Function>
Function* Next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" [[gnu::visibility("default")]] int connect(int socket, const sockaddr* address,
                                                      socklen_t size) {
  static const auto next = Next<int(int, const sockaddr*, socklen_t)>("connect");
  const int result = next(socket, address, size);
  if (result != 0 && errno == ENOENT && has_machine && address->sa_family == AF_UNIX) {
    errno = ECONNREFUSED;
  }
  return result;
}

extern "C" [[gnu::visibility("default")]] ssize_t sendmsg(int socket, const msghdr* message,
                                                          int flags) {
  static const auto next = Next<ssize_t(int, const msghdr*, int)>("sendmsg");
  const ssize_t sent = next(socket, message, flags);
  const int error = errno;
  if (sent >= 0 || (error != ECONNREFUSED && error != EAGAIN) || !has_machine) return sent;
  const bool local = IsLocal(socket);
  errno = error;
  if (!local) return sent;
  ssize_t bytes = 0;
  for (std::size_t i = 0; i < message->msg_iovlen; ++i) {
    bytes += static_cast<ssize_t>(message->msg_iov[i].iov_len);
  }
  return bytes;
}

namespace torquer::emulator {

UMockdevTestbed* NewMockedMachine() {
  has_machine = true;
  return umockdev_testbed_new();
}

}  // namespace torquer::emulator
