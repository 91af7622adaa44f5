// Tests of the bars of --monitor and of the notifications to a service manager.
#include "host/daemon/device_monitor.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <cstdlib>

#include "host/daemon/service_manager.h"
#include "protocol/lcm_channels.h"
#include "tests/support/temporary_folder.h"

namespace {

using torquer::daemon::DeviceBars;
using torquer::daemon::PipelineOutput;
using torquer::daemon::ServiceManager;
using torquer::device::EpochStart;

PipelineOutput Output(int millisecond) {
  PipelineOutput output;
  output.origin_us = 1000LL * millisecond;
  output.sample.report_number = millisecond;
  output.sample.joystick_x = 512;
  output.sample.joystick_y = 0;
  output.sample.surface_quality = 80;
  output.hand.pose.insertion_mm = 0.1 * millisecond;  // 100 mm/s
  output.hand.pose.rotation_rad = -0.001 * millisecond;
  return output;
}

bool Contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

// First line that begins with `begin`; "" if there is none.
std::string LineOf(const std::vector<std::string>& lines, const std::string& begin) {
  for (const std::string& line : lines) {
    if (line.rfind(begin, 0) == 0) return line;
  }
  return "";
}

// Content of a bar, left and right of its middle.
std::pair<std::string, std::string> Halves(const std::string& line) {
  const std::size_t from = line.find('[') + 1;
  const std::size_t middle = line.find('|');
  return {line.substr(from, middle - from), line.substr(middle + 1, line.find(']') - middle - 1)};
}

// Receiver of a daemon's notifications.
class Manager {
 public:
  explicit Manager(const std::string& name) {
    fd_ = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, sizeof address.sun_path - 1);
    if (name[0] == '@') address.sun_path[0] = '\0';
    const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
    REQUIRE(bind(fd_, reinterpret_cast<const sockaddr*>(&address), size) == 0);
    setenv("NOTIFY_SOCKET", name.c_str(), 1);
  }
  ~Manager() {
    close(fd_);
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;

  std::string Received() {
    char text[1000];
    const ssize_t size = recv(fd_, text, sizeof text, 0);
    return size < 0 ? "" : std::string(text, static_cast<std::size_t>(size));
  }

 private:
  int fd_;
};

}  // namespace

TEST_CASE("Bars show speed, joystick and surface; words show buttons and problems") {
  DeviceBars bars;
  CHECK(bars.Lines(0.1, 80) == std::vector<std::string>{"no report yet"});
  bars.Add("BENCH-7", Output(0));
  bars.Lines(0.1, 80);
  for (int i = 1; i <= 100; ++i) bars.Add("BENCH-7", Output(i));
  std::vector<std::string> lines = bars.Lines(0.1, 80);
  CHECK(Contains(lines[0], "BENCH-7"));
  CHECK(Contains(lines[0], "1000 reports/s, 0 missing"));
  for (const std::string& line : lines) CHECK(line.size() <= 80);

  const std::string insertion = LineOf(lines, "insertion");
  CHECK(Contains(insertion, "10.00 mm"));
  const auto [backward, forward] = Halves(insertion);
  CHECK_FALSE(Contains(backward, "#"));
  // Half of the full speed of 200 mm/s.
  CHECK(std::count(forward.begin(), forward.end(), '#') ==
        Approx(static_cast<double>(forward.size()) / 2).margin(1));
  CHECK(Contains(Halves(LineOf(lines, "rotation")).first, "#"));
  CHECK_FALSE(Contains(LineOf(lines, "joystick x"), "#"));
  const auto down = Halves(LineOf(lines, "joystick y")).first;
  CHECK(std::count(down.begin(), down.end(), '#') == static_cast<int>(down.size()));
  CHECK(Contains(LineOf(lines, "surface"), "#"));
  CHECK(LineOf(lines, "now: ") == "now: -");

  PipelineOutput last = Output(111);
  last.sample.buttons = torquer::protocol::kButtonClutch;
  last.hand.flags = torquer::protocol::kCommandLift | torquer::protocol::kCommandUncalibrated;
  bars.Add("BENCH-7", last);
  CHECK(Contains(LineOf(bars.Lines(0.1, 80), "now: "), "clutch, LIFTED OR POOR SURFACE, uncal"));
  last.sample.report_number += 2;
  bars.Add("BENCH-7", last);
  CHECK(Contains(bars.Line(0.1), "BENCH-7: 10 reports/s, 11 missing, 11.10 mm"));
}

TEST_CASE("A gap at a new connection is not a loss") {
  DeviceBars bars;
  bars.Add("BENCH-7", Output(0));
  PipelineOutput again = Output(5000);
  again.sample.epoch_start = EpochStart::kConnected;
  bars.Add("BENCH-7", again);
  CHECK(Contains(bars.Line(0.1), "0 missing"));
}

TEST_CASE("A narrow terminal gets narrow bars") {
  DeviceBars bars;
  bars.Add("BENCH-7", Output(0));
  for (const std::size_t width : {1u, 20u, 40u, 500u}) {
    for (const std::string& line : bars.Lines(0.1, width)) CHECK(line.size() <= width);
  }
}

TEST_CASE("A service manager gets its notifications, at the requested rate") {
  const torquer::test::TemporaryFolder folder;
  for (const std::string& name :
       {folder.Path("notify"), "@torquer-test-" + std::to_string(getpid())}) {
    Manager manager(name);
    setenv("WATCHDOG_USEC", "1000000", 1);
    ServiceManager daemon;
    daemon.Ready();
    CHECK(manager.Received() == "READY=1");
    daemon.Status("running: all well\nREADY=0");
    CHECK(manager.Received() == "STATUS=running: all well");
    daemon.Alive(10000000);
    CHECK(manager.Received() == "WATCHDOG=1");
    daemon.Alive(10499999);
    CHECK(manager.Received().empty());
    daemon.Alive(10500000);
    CHECK(manager.Received() == "WATCHDOG=1");
    daemon.Stopping();
    CHECK(manager.Received() == "STOPPING=1");
  }
}

TEST_CASE("The watchdog of another process is ignored, and a missing watchdog is accepted") {
  const torquer::test::TemporaryFolder folder;
  {
    Manager manager(folder.Path("notify"));
    setenv("WATCHDOG_USEC", "1000000", 1);
    setenv("WATCHDOG_PID", "1", 1);
    ServiceManager daemon;
    daemon.Alive(10000000);
    CHECK(manager.Received().empty());
  }
  setenv("NOTIFY_SOCKET", folder.Path("nobody").c_str(), 1);
  ServiceManager daemon;
  daemon.Ready();
  unsetenv("NOTIFY_SOCKET");
}
