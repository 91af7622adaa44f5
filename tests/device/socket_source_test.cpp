// Socket source of the daemon, connected to a device that does not answer.
#include "host/device/socket_source.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "tests/support/temporary_folder.h"

namespace torquer::device {
namespace {

// Listens but accepts no connection, like a stopped emulator.
class HangingDevice {
 public:
  explicit HangingDevice(const std::string& path) {
    fd_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    REQUIRE(bind(fd_, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0);
    REQUIRE(listen(fd_, 0) == 0);
  }
  ~HangingDevice() { close(fd_); }

 private:
  int fd_;
};

void IgnoreEvents(const SourceEvent&) {}

// Fails the test by SIGALRM if a call never returns.
struct Deadline {
  Deadline() { alarm(10); }
  ~Deadline() { alarm(0); }
};

TEST_CASE("A device whose queue of connections is full is not waited for") {
  const test::TemporaryFolder folder;
  const HangingDevice device(folder.Path("device.sock"));
  const Deadline deadline;
  SocketSource first(folder.Path("device.sock")), second(folder.Path("device.sock"));
  int connected = 0;
  const auto count = [&connected](const SourceEvent& event) {
    if (event.kind == SourceEvent::Kind::kConnected) ++connected;
  };
  first.Wait(0, count);
  second.Wait(0, count);
  CHECK(connected == 1);
}

TEST_CASE("A device that stops taking requests is reported as not answering") {
  const test::TemporaryFolder folder;
  const HangingDevice device(folder.Path("device.sock"));
  const Deadline deadline;
  SocketSource source(folder.Path("device.sock"));
  source.Wait(0, IgnoreEvents);
  const std::vector<std::uint8_t> large(150000);  // most of a socket's buffer
  bool full = false;
  // Sends until the socket's buffer is full; the first request that does not fit fails at once.
  for (int request = 0; request < 3 && !full; ++request) {
    try {
      source.SetFeature(large);
    } catch (const FeatureTimeout& timeout) {
      full = std::string(timeout.what()) == "the device accepts no requests";
    }
  }
  CHECK(full);
}

}  // namespace
}  // namespace torquer::device
