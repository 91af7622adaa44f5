// torquer-recorder: writes the messages of a session into a log.

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/support/event_log_writer.h"
#include "host/support/printable_text.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "protocol/lcm_channels.h"

namespace {

constexpr std::int64_t kFlushUs = 100'000;
constexpr int kWaitMs = 20;
// At the end the kernel may still have what was sent before.
constexpr int kLastWaitMs = 100;
constexpr std::int64_t kEndUs = 1'000'000;

// Since 1970, less MonotonicUs().
std::int64_t EpochOffsetUs() {
  using std::chrono::duration_cast;
  using std::chrono::microseconds;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return duration_cast<microseconds>(now).count() - torquer::bus::MonotonicUs();
}

int Run(const std::string& path, const std::string& url) {
  if (path.empty()) throw torquer::UsageError("LOG is missing; name the file to be written");
  torquer::bus::Bus bus(url);
  // After the bus: who sees the file knows that nothing is missed from now on.
  std::optional<torquer::EventLogWriter> log;
  const std::int64_t offset_us = EpochOffsetUs();
  for (const char* channel : torquer::protocol::kChannels) {
    bus.SubscribeBytes(channel, [&log, channel, offset_us](std::span<const std::uint8_t> data,
                                                           const torquer::bus::Arrival& arrival) {
      log->Write(arrival.received_us + offset_us, channel, data);
    });
  }
  log.emplace(path);
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  std::int64_t flushed_us = torquer::bus::MonotonicUs();
  const auto work = [&](int wait_ms) {
    const bool any = bus.Handle(wait_ms) > 0;
    const std::int64_t now_us = torquer::bus::MonotonicUs();
    if (now_us - flushed_us < kFlushUs) return any;
    flushed_us = now_us;
    log->Flush();
    const std::string notice = bus.TakeNotice(now_us);
    if (!notice.empty()) fmt::print(stderr, "torquer-recorder: {}\n", torquer::Printable(notice));
    return any;
  };
  while (!stop) work(kWaitMs);
  // What came before the end, but not what comes without end.
  const std::int64_t end_us = torquer::bus::MonotonicUs() + kEndUs;
  while (work(kLastWaitMs) && torquer::bus::MonotonicUs() < end_us) {
  }
  log->Finish();
  fmt::print("{} messages, {:.1f} MB in {}\n", log->records(),
             1e-6 * static_cast<double>(log->bytes()), path);
  if (bus.dropped() == 0) return torquer::kExitSuccess;
  fmt::print(stderr, "torquer-recorder: {} messages are missing: they came faster than {} takes\n",
             bus.dropped(), path);
  return torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-recorder",
                           "Writes every message of the session on the bus into a log, which "
                           "torquer-report, torquer-simulator --replay and LCM's own programs "
                           "read. Ends at SIGINT or SIGTERM.");
  program.Note(
      "Exit status: 0 when the log is complete; 1 when messages were dropped; 2 when it cannot be "
      "written.");
  std::string path;
  std::string url;
  torquer::Options& options = program.options();
  options.Operand("LOG", path, "file to be written; it must not be there yet");
  options.Text("--lcm-url", "URL", url,
               "message bus; without it LCM_DEFAULT_URL, else multicast on this machine");
  return program.Main(argc, argv, [&] { return Run(path, url); });
}
