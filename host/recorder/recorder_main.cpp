// torquer-recorder: writes the messages of a session into a log.

#include <fmt/format.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <span>
#include <string>

#include "host/bus/bus.h"
#include "host/bus/clock.h"
#include "host/recorder/rotating_log.h"
#include "host/recorder/shape_thinner.h"
#include "host/support/error_output.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"
#include "protocol/lcm_channels.h"

namespace {

constexpr std::int64_t kFlushUs = 100'000;
constexpr int kWaitMs = 20;
// At the end the kernel may still hold messages that were sent before.
constexpr int kLastWaitMs = 100;
constexpr std::int64_t kEndUs = 1'000'000;

// Offset in us from MonotonicUs() to the time since 1970.
std::int64_t EpochOffsetUs() {
  using std::chrono::duration_cast;
  using std::chrono::microseconds;
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return duration_cast<microseconds>(now).count() - torquer::bus::MonotonicUs();
}

struct Arguments {
  std::string path;
  std::string url;
  std::optional<double> shapes_hz;
  std::optional<double> part_mb;
  std::optional<int> keep;
};

// Writes the messages of a bus into a log.
class Recorder {
 public:
  explicit Recorder(const Arguments& arguments) : arguments_(arguments), bus_(arguments.url) {
    if (arguments.shapes_hz) thinner_.emplace(*arguments.shapes_hz);
    for (const char* channel : torquer::protocol::kChannels) {
      const bool is_state = channel == torquer::protocol::kWireStateChannel;
      bus_.SubscribeBytes(channel, [this, channel, is_state](std::span<const std::uint8_t> data,
                                                             const torquer::bus::Arrival& arrival) {
        newest_us_ = arrival.received_us;
        if (is_state && thinner_) data = thinner_->Take(data, arrival.received_us);
        log_->Write(arrival.received_us + offset_us_, channel, data);
      });
    }
    // Create the file after the bus: once the file exists, no message is missed.
    log_.emplace(arguments.path, std::llround(1e6 * arguments.part_mb.value_or(0)),
                 arguments.keep.value_or(0));
  }

  // Records until `stop`, or until the disk is nearly full.
  void Run(const std::atomic<bool>& stop) {
    while (!stop && has_room_) Work(kWaitMs);
    // Drain the messages sent before the end. A deadline bounds this if messages keep coming.
    const std::int64_t end_us = torquer::bus::MonotonicUs() + kEndUs;
    while (has_room_ && Work(kLastWaitMs) && torquer::bus::MonotonicUs() < end_us) {
    }
    if (thinner_ && !thinner_->Owed().empty()) {
      log_->Write(newest_us_ + offset_us_, torquer::protocol::kWireStateChannel, thinner_->Owed());
    }
    log_->Finish();
  }

  int Report() const {
    fmt::print("{} messages, {:.1f} MB in {}", log_->records(),
               1e-6 * static_cast<double>(log_->bytes()), arguments_.path);
    if (log_->parts() > 1) fmt::print(" and its parts, {} in all", log_->parts());
    if (log_->removed() > 0) fmt::print("; the oldest {} are removed", log_->removed());
    fmt::print("\n");
    if (!has_room_) {
      torquer::PrintError(
          "torquer-recorder: {}: ends here and is complete: its disk has less than {} MB free, "
          "which are reserved for other programs; free space, record to another disk, or record "
          "less (--shapes, --part-mb with --keep)\n",
          arguments_.path, torquer::RotatingLog::kLeastFreeBytes / 1'000'000);
    }
    if (bus_.dropped() > 0) {
      torquer::PrintError(
          "torquer-recorder: {} messages are missing: they arrived faster than {} could be "
          "written\n",
          bus_.dropped(), arguments_.path);
    }
    return has_room_ && bus_.dropped() == 0 ? torquer::kExitSuccess : torquer::kExitFailure;
  }

 private:
  // Returns true if a message arrived.
  bool Work(int wait_ms) {
    const bool any = bus_.Handle(wait_ms) > 0;
    const std::int64_t now_us = torquer::bus::MonotonicUs();
    if (now_us - flushed_us_ < kFlushUs) return any;
    flushed_us_ = now_us;
    log_->Flush();
    // Each part is a separate log, so it needs a shape at its start.
    if (log_->Rotate() && thinner_) thinner_->WantShape();
    has_room_ = log_->FreeBytes() >= torquer::RotatingLog::kLeastFreeBytes;
    const std::string notice = bus_.TakeNotice(now_us);
    if (!notice.empty()) torquer::PrintError("torquer-recorder: {}\n", notice);
    return any;
  }

  const Arguments& arguments_;
  torquer::bus::Bus bus_;
  std::optional<torquer::ShapeThinner> thinner_;
  std::optional<torquer::RotatingLog> log_;
  const std::int64_t offset_us_ = EpochOffsetUs();
  std::int64_t newest_us_ = 0;
  std::int64_t flushed_us_ = torquer::bus::MonotonicUs();
  bool has_room_ = true;
};

int Run(const Arguments& arguments) {
  if (arguments.path.empty()) throw torquer::UsageError("LOG is missing; name the file to write");
  if (arguments.keep && !arguments.part_mb) {
    throw torquer::UsageError("--keep needs --part-mb; give both");
  }
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  Recorder recorder(arguments);
  recorder.Run(stop);
  return recorder.Report();
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program(
      "torquer-recorder",
      "Writes every message on the bus to a log, until SIGINT or SIGTERM. torquer-report, "
      "torquer-simulator --replay and LCM's programs read the log.");
  program.Note(
      "Exit status: 0 when the log is complete; 1 when messages were dropped or the disk was "
      "nearly full; 2 when the log cannot be written.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Operand("LOG", arguments.path, "log file to write; it must not exist yet");
  options.Text(
      "--lcm-url", "URL", arguments.url,
      "URL of the message bus; without it LCM_DEFAULT_URL, or else multicast on this machine");
  options.Number("--shapes", "HZ", arguments.shapes_hz, 0.1, 10'000,
                 "largest number of wire shapes recorded per second; further states are recorded "
                 "without shape and contacts");
  options.Number("--part-mb", "MB", arguments.part_mb, 0.1, 1e6,
                 "size at which a new part of the log begins: LOG.part002, LOG.part003, ...");
  options.Integer("--keep", "N", arguments.keep, 1, 100'000,
                  "number of newest parts to keep; older parts are removed");
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
