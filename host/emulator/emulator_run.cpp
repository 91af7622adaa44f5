#include "host/emulator/emulator_run.h"

#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <filesystem>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/input_file.h"
#include "protocol/hid_reports.h"

namespace torquer::emulator {
namespace {

constexpr std::int64_t kFrameNs = 1000000;
// Longest stall that is caught up. After a longer one, a burst of frames would be of no use.
constexpr std::int64_t kLongestCatchUpNs = 1000 * kFrameNs;
// Timeout of a fast emulator for a client that takes no reports, or does not come back.
constexpr int kFastClientTimeoutMs = 10000;
// At rest after the end of the file, so that the last counts reach the client.
constexpr double kRestAfterMotion_s = 0.25;
constexpr int kFramesATruth = 10;

std::int64_t MonotonicNs() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return now.tv_sec * 1000000000LL + now.tv_nsec;
}

std::vector<std::uint8_t> LoadEeprom(const std::string& path) {
  std::error_code error;
  if (path.empty() || (!std::filesystem::exists(path, error) && !error)) return {};
  constexpr char kRemedyOf[] = "give a file that this program wrote, or a new name";
  const std::string bytes = ReadInputFile(path, kRemedyOf);
  if (bytes.size() != Atmega32u4::kEepromBytes) {
    throw UserError(fmt::format("--eeprom '{}': {} bytes could be read, the chip has {}; {}", path,
                                bytes.size(), Atmega32u4::kEepromBytes, kRemedyOf));
  }
  return {bytes.begin(), bytes.end()};
}

BenchOptions WithEeprom(BenchOptions bench, const std::string& path) {
  bench.eeprom = LoadEeprom(path);
  return bench;
}

bool Within(const std::vector<Interval>& intervals, double time_s) {
  return std::any_of(intervals.begin(), intervals.end(), [time_s](const Interval& interval) {
    return time_s >= interval.start_s && time_s < interval.start_s + interval.duration_s;
  });
}

}  // namespace

EmulatorRun::EmulatorRun(const RunOptions& options)
    : options_(options),
      script_(options.motion.empty() ? MotionScript() : MotionScript::FromFile(options.motion)),
      device_(FirmwareImage::Load(options.firmware, options.bootloader),
              WithEeprom(options.bench, options.eeprom_file)),
      host_(device_),
      socket_(host_, options.socket),
      random_(options.bench.seed) {
  // A file that cannot be written is refused before the run, not after it.
  if (!options_.eeprom_file.empty()) AtomicFile{options_.eeprom_file};
  if (options_.use_lcm) bus_ = std::make_unique<LiveBus>(options_.lcm_url);
  std::sort(options_.resets_s.begin(), options_.resets_s.end());
  device_.SetHand([this](double time_s) { return HandAt(time_s); });
  host_.wants_input = [this] {
    return options_.fast ? socket_.WaitUntilSent(kFastClientTimeoutMs) : socket_.CanSend();
  };
  host_.on_input = [this](const std::vector<std::uint8_t>& report) { Deliver(report); };
  host_.on_ready = [this] {
    summary_.serial = host_.enumeration().serial;
    if (bus_) bus_->SetSerial(summary_.serial);
    socket_.DeviceReady();
    client_awaited_ = true;
    awaited_since_ns_ = MonotonicNs();
  };
  host_.on_gone = [this] {
    socket_.DeviceGone();
    client_awaited_ = false;
  };
}

double EmulatorRun::MotionTime(double time_s) const {
  return motion_start_s_ ? std::max(0.0, time_s - *motion_start_s_) : 0.0;
}

HandState EmulatorRun::HandAt(double time_s) const {
  HandState hand = options_.motion.empty() ? live_hand_.At(time_s) : script_.At(MotionTime(time_s));
  hand.raises = motion_start_s_ && Within(options_.raises, MotionTime(time_s));
  return hand;
}

void EmulatorRun::Deliver(const std::vector<std::uint8_t>& report) {
  ++summary_.reports_sent;
  const bool second = !report.empty() && report[0] == protocol::kSecondInputReportId;
  ++(second ? sent_.catheter : sent_.wire);
  if (random_.Chance(options_.drop_probability)) {
    ++summary_.reports_dropped;
    return;
  }
  socket_.Send(report);
  if (random_.Chance(options_.repeat_probability)) {
    ++summary_.reports_repeated;
    socket_.Send(report);
  }
}

bool EmulatorRun::Finished() const {
  if (!motion_start_s_) return false;
  const double time_s = MotionTime(device_.now_us() * 1e-6);
  if (options_.duration_s) return time_s >= *options_.duration_s;
  return !options_.motion.empty() && time_s >= script_.duration_s() + kRestAfterMotion_s;
}

void EmulatorRun::FollowEvents() {
  const double now_s = device_.now_us() * 1e-6;
  const bool can_begin = options_.wait_client ? socket_.connected() : host_.ready();
  if (!motion_start_s_ && can_begin && device_.sensor().counting()) {
    motion_start_s_ = now_s;
  }
  if (!motion_start_s_) return;
  const double time_s = MotionTime(now_s);
  device_.sensor().SetLifted(Within(options_.lifts, time_s));
  device_.sensor().SetFault(Within(options_.faults, time_s) ? VirtualPmw3360::Fault::kSilent
                                                            : VirtualPmw3360::Fault::kNone);
  const bool unplugged = Within(options_.unplugs, time_s);
  if (unplugged && device_.powered()) {
    device_.PowerOff();
    SaveEeprom();
  } else if (!unplugged && !device_.powered()) {
    device_.PowerOn();
  }
  while (resets_done_ < options_.resets_s.size() && time_s >= options_.resets_s[resets_done_]) {
    ++resets_done_;
    device_.ResetByPin();
  }
}

void EmulatorRun::Pace() {
  if (options_.fast) return;
  const std::int64_t now_ns = MonotonicNs();
  if (next_frame_ns_ == 0) next_frame_ns_ = now_ns;
  if (now_ns < next_frame_ns_) {
    const timespec wake{static_cast<time_t>(next_frame_ns_ / 1000000000),
                        static_cast<long>(next_frame_ns_ % 1000000000)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &wake, nullptr);
  }
  const std::int64_t late_ns = MonotonicNs() - next_frame_ns_;
  const double late_ms = static_cast<double>(late_ns) * 1e-6;
  summary_.latest_frame_ms = std::max(summary_.latest_frame_ms.value_or(late_ms), late_ms);
  if (late_ns > kLongestCatchUpNs) next_frame_ns_ += late_ns;
  next_frame_ns_ += kFrameNs;
}

bus::HealthCounters EmulatorRun::Counters() const {
  return {{"reports_sent", summary_.reports_sent},
          {"reports_dropped", summary_.reports_dropped},
          {"reports_repeated", summary_.reports_repeated},
          {"axial_counts", device_.sensor().axial_counts()},
          {"transverse_counts", device_.sensor().transverse_counts()},
          {"violations", device_.violation_count()},
          {"messages_refused", bus_->refused()}};
}

void EmulatorRun::Publish() {
  const double now_s = device_.now_us() * 1e-6;
  bus_->PublishTruth(device_, now_s, HandAt(now_s), sent_);
  if (!device_.powered()) {
    bus_->PublishHealth("unplugged", "the device is unplugged", Counters());
  } else if (!host_.ready()) {
    bus_->PublishHealth("starting", "the device is not on the bus yet", Counters());
  } else if (!socket_.connected()) {
    bus_->PublishHealth("waiting for client", "no program is connected to " + socket_.path(),
                        Counters());
  } else {
    bus_->PublishHealth("running", "a client takes reports", Counters());
  }
}

bool EmulatorRun::HeldForClient() {
  if (socket_.connected()) client_awaited_ = false;
  if (!options_.fast || !options_.wait_client || !client_awaited_) return false;
  const std::int64_t waited_ms = (MonotonicNs() - awaited_since_ns_) / 1000000;
  if (motion_start_s_ && waited_ms > kFastClientTimeoutMs) {
    client_awaited_ = false;
    return false;
  }
  socket_.WaitForClient(20);
  return true;
}

RunSummary EmulatorRun::Run(const std::atomic<bool>& stop) {
  while (!stop && !Finished()) {
    Pace();
    socket_.Service();
    if (HeldForClient()) continue;
    if (bus_) bus_->Service(device_.now_us() * 1e-6, &live_hand_);
    FollowEvents();
    host_.RunFrame();
    if (bus_ && ++frames_ % kFramesATruth == 0) Publish();
  }
  if (bus_) {
    Publish();
    bus_->PublishHealth("stopping", "the emulator ends", Counters());
  }
  SaveEeprom();
  socket_.WaitUntilSent(kFastClientTimeoutMs);
  socket_.DeviceGone();
  summary_.axial_counts = device_.sensor().axial_counts();
  summary_.transverse_counts = device_.sensor().transverse_counts();
  if (device_.second_sensor() != nullptr) {
    summary_.catheter_axial_counts = device_.second_sensor()->axial_counts();
    summary_.catheter_transverse_counts = device_.second_sensor()->transverse_counts();
  }
  summary_.violations = device_.violation_count();
  summary_.violation_texts = device_.Violations();
  summary_.time_simulated_s = device_.now_us() * 1e-6;
  summary_.cycles_used_fraction = device_.CyclesUsedFraction();
  return summary_;
}

void EmulatorRun::SaveEeprom() const {
  if (options_.eeprom_file.empty()) return;
  const std::vector<std::uint8_t> bytes = device_.Eeprom();
  WriteFileAtomically(options_.eeprom_file,
                      {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace torquer::emulator
