// torquer-monitor: a live line about the session on the bus.

#include <sys/ioctl.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/support/command_line.h"
#include "host/support/error.h"
#include "host/tools/live_status.h"
#include "protocol/lcm_channels.h"

namespace {

constexpr char kUsage[] =
    "usage: torquer-monitor [--lcm-url URL] [--duration SECONDS]\n"
    "Tells how the session on the bus fares: on a terminal in one line that changes five times a\n"
    "second, elsewhere in a line a second. Ends after --duration, or at SIGINT or SIGTERM.\n";

std::atomic<bool> stop{false};

double ParseDuration(const std::string& text) {
  char* end = nullptr;
  const double seconds = std::strtod(text.c_str(), &end);
  if (end == text.c_str() || *end != '\0' || !(seconds > 0)) {
    throw torquer::UserError("--duration " + text + " is no number of seconds above 0");
  }
  return seconds;
}

// Columns of the terminal; 0 where there is none.
std::size_t TerminalWidth() {
  winsize size{};
  if (isatty(STDOUT_FILENO) == 0) return 0;
  if (ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

void Show(const std::string& line, bool lasting, std::size_t width) {
  if (width == 0) {
    std::printf("%s\n", line.c_str());
  } else if (lasting) {
    std::printf("\r\033[K%s\n", line.c_str());
  } else {
    // A line that wraps could not be overwritten.
    std::printf("\r\033[K%s", line.substr(0, width - 1).c_str());
  }
  std::fflush(stdout);
}

int Run(const std::string& url, double duration_s) {
  torquer::bus::Bus bus(url);
  const std::size_t width = TerminalWidth();
  torquer::tools::LiveStatus status(torquer::bus::ClockId());
  bus.Subscribe<torquer_lcm::device_sample_t>(
      torquer::protocol::kDeviceSampleChannel, [&](const auto& message) { status.Add(message); },
      0);
  bus.Subscribe<torquer_lcm::wire_state_t>(
      torquer::protocol::kWireStateChannel, [&](const auto& message) { status.Add(message); }, 0);
  bus.Subscribe<torquer_lcm::scene_description_t>(
      torquer::protocol::kSceneChannel, [&](const auto& message) { status.Add(message); });
  bus.Subscribe<torquer_lcm::readings_t>(torquer::protocol::kReadingsChannel,
                                         [&](const auto& message) {
                                           const std::string news = status.Add(message);
                                           if (!news.empty()) Show(news, true, width);
                                         });
  bus.Subscribe<torquer_lcm::health_t>(torquer::protocol::kHealthChannel, [&](const auto& message) {
    const std::string news = status.Add(message);
    if (!news.empty()) Show(news, true, width);
  });
  std::signal(SIGINT, [](int) { stop = true; });
  std::signal(SIGTERM, [](int) { stop = true; });

  const std::int64_t start_us = torquer::bus::MonotonicUs();
  const std::int64_t end_us = start_us + static_cast<std::int64_t>(1e6 * duration_s);
  const std::int64_t interval_us = width > 0 ? 200'000 : 1'000'000;
  std::int64_t shown_us = start_us;
  bool ended = false;
  while (!ended) {
    // In batches: a wake-up for each message would take from what it watches.
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    bus.Handle(0);
    const std::int64_t now_us = torquer::bus::MonotonicUs();
    ended = stop || (duration_s > 0 && now_us >= end_us);
    if (ended || now_us - shown_us >= interval_us) {
      Show(status.Line(1e-6 * static_cast<double>(now_us - shown_us)), ended, width);
      shown_us = now_us;
    }
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    std::string url;
    double duration_s = 0;
    bool help = false;
    torquer::CommandLine line;
    line.Option("--lcm-url", url);
    line.Option("--duration", [&](const std::string& text) { duration_s = ParseDuration(text); });
    line.Flag("--help", help);
    line.Parse(argc, argv, kUsage);
    if (help) {
      std::fputs(kUsage, stdout);
      return 0;
    }
    return Run(url, duration_s);
  } catch (const torquer::UserError& error) {
    std::fprintf(stderr, "torquer-monitor: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
