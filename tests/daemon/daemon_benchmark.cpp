// daemon_benchmark measures the daemon at 1 kHz: report-to-command latency and share of a core.

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "host/support/program.h"
#include "tests/support/daemon_process.h"
#include "tests/support/reports.h"
#include "tests/support/socket_device.h"

namespace {

int Run(int seconds) {
  torquer::test::NeedPrivateNetwork();
  const torquer::test::TemporaryFolder folder;
  setenv("XDG_RUNTIME_DIR", folder.Path().c_str(), 1);
  const std::string socket = folder.Path("device");
  torquer::test::SocketDevice device(socket);
  torquer::test::ChildProcess daemon(
      torquer::test::SocketWords(socket, {"--uncalibrated", "--json"}));
  if (!device.WaitForHost()) return 1;

  torquer::protocol::InputReport report = torquer::test::StillReport();
  auto next = std::chrono::steady_clock::now();
  for (int i = 0; i < 1000 * seconds; ++i) {
    next += std::chrono::milliseconds(1);
    std::this_thread::sleep_until(next);
    report = torquer::test::Next(report);
    report.axial_counts += 20;
    device.Send(report);
  }
  daemon.Signal(SIGTERM);
  const int status = daemon.Wait();
  std::fputs(daemon.Output().c_str(), stdout);
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "daemon_benchmark",
      "Measures what the daemon costs at 1 kHz: a scripted device sends a report "
      "a millisecond over a socket, the daemon publishes into a private network, "
      "where nobody listens. Prints the daemon's own statistics.");
  int seconds = 10;
  program.options().Integer("--seconds", "S", seconds, 1, 100000, "how long");
  return program.Main(argc, argv, [&] { return Run(seconds); });
}
