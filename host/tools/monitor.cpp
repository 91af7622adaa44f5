// torquer-monitor: reports on the session on the bus.

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>
#include <thread>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "host/tools/live_status.h"
#include "protocol/lcm_channels.h"

namespace {

// Columns of the terminal; 0 if there is no terminal.
std::size_t TerminalWidth() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 0) return 0;
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

void Show(const std::string& line, bool lasting) {
  const std::size_t width = TerminalWidth();  // it may have changed
  if (width == 0) {
    fmt::print("{}\n", line);
  } else if (lasting) {
    fmt::print("\r\033[K{}\n", line);
  } else {
    // A wrapped line could not be overwritten.
    fmt::print("\r\033[K{}", torquer::tools::FittingParts(line, width - 1));
  }
  std::fflush(stdout);
}

int Run(const std::string& url, std::optional<double> duration_s) {
  torquer::bus::Bus bus(url);
  torquer::tools::LiveStatus status(torquer::bus::ClockId());
  bus.Subscribe<torquer_lcm::device_sample_t>(
      torquer::protocol::kDeviceSampleChannel, [&](const auto& message) { status.Add(message); },
      0);
  bus.SubscribeWithArrival<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel,
      [&](const auto& message, const auto& arrival) {
        status.Add(message, arrival.sender, torquer::bus::MonotonicUs());
      },
      0);
  bus.SubscribeWithArrival<torquer_lcm::scene_description_t>(
      torquer::protocol::kSceneChannel,
      [&](const auto& message, const auto& arrival) { status.Add(message, arrival.sender); });
  bus.Subscribe<torquer_lcm::readings_t>(torquer::protocol::kReadingsChannel,
                                         [&](const auto& message) {
                                           const std::string news = status.Add(message);
                                           if (!news.empty()) Show(news, true);
                                         });
  bus.Subscribe<torquer_lcm::health_t>(torquer::protocol::kHealthChannel, [&](const auto& message) {
    const std::string news = status.Add(message, torquer::bus::MonotonicUs());
    if (!news.empty()) Show(news, true);
  });
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  const std::int64_t start_us = torquer::bus::MonotonicUs();
  const std::int64_t end_us = start_us + static_cast<std::int64_t>(1e6 * duration_s.value_or(0));
  const std::int64_t interval_us = isatty(STDOUT_FILENO) != 0 ? 200'000 : 1'000'000;
  std::int64_t shown_us = start_us;
  bool ended = false;
  while (!ended) {
    // Messages are handled in batches: a wake-up for each would slow down the observed session.
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    bus.Handle(0);
    const std::int64_t now_us = torquer::bus::MonotonicUs();
    const std::string notice = bus.TakeNotice(now_us);
    if (!notice.empty()) Show(notice, true);
    ended = stop || (duration_s && now_us >= end_us);
    if (ended || now_us - shown_us >= interval_us) {
      Show(status.Line(1e-6 * static_cast<double>(now_us - shown_us), now_us), ended);
      shown_us = now_us;
    }
  }
  return torquer::kExitSuccess;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-monitor",
      "Shows the state of the session on the bus, until SIGINT or SIGTERM. On a terminal it "
      "updates one line five times a second. Otherwise it prints one line per second.");
  std::string url;
  std::optional<double> duration_s;
  torquer::Options& options = program.options();
  options.Text(
      "--lcm-url", "URL", url,
      "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this machine");
  options.Number("--duration", "S", duration_s, 0.001, 1e6, "time after which the program ends");
  return program.Main(argc, argv, [&] { return Run(url, duration_s); });
}
