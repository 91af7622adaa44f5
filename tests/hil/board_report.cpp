#include "tests/hil/board_report.h"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iterator>
#include <map>
#include <thread>
#include <vector>

#include "calibration/calibration_file.h"
#include "calibration/focus.h"
#include "host/bus/clock.h"
#include "host/device/report_copy.h"
#include "host/device/report_decoder.h"
#include "host/device/sensor_firmware.h"
#include "host/device/sensor_picture.h"
#include "host/device/source_reports.h"
#include "host/device/usb_source.h"
#include "host/support/error.h"
#include "host/tools/focus_picture.h"
#include "host/tools/fuses.h"
#include "protocol/usb_ids.h"
#include "tests/hil/timing_report.h"
#include "torquer_version.h"

namespace torquer::hil {
namespace {

using protocol::ConfigurationReport;
using protocol::DiagnosticsReport;
using protocol::IdentityReport;

constexpr std::int64_t kPatienceUs = 60000000;
// Number of pictures per verdict; between them the sensor restarts and the hand moves on.
constexpr int kPictures = 4;
constexpr std::int64_t kBetweenUs = 400000;

// A connected device, and the state that its reports contain.
class Board {
 public:
  explicit Board(const std::string& serial) : source_(serial) {
    const std::int64_t begin_us = bus::MonotonicUs();
    while (!connected_) {
      source_.Wait(50, [this](const device::SourceEvent& event) { Take(event); });
      if (bus::MonotonicUs() - begin_us > kPatienceUs) {
        throw UserError("no bench device at " + source_.place() + "; is it plugged in?");
      }
    }
  }

  void Read(std::int64_t us) {
    const std::int64_t end_us = bus::MonotonicUs() + us;
    while (bus::MonotonicUs() < end_us) {
      source_.Wait(20, [this](const device::SourceEvent& event) { Take(event); });
    }
  }
  void Forget() { surface_.clear(), shutter_.clear(), flags_.clear(); }

  std::string Surface() const {
    if (surface_.empty()) return "no reports\n";
    const auto spread = [](std::vector<int> values) {
      std::sort(values.begin(), values.end());
      return fmt::format("median {}, {} to {}", values[values.size() / 2], values.front(),
                         values.back());
    };
    std::string text = fmt::format("surface quality (SQUAL): {}\nshutter: {}\n", spread(surface_),
                                   spread(shutter_));
    for (const auto& [flags, count] : flags_) {
      text += fmt::format("flags {:#04x} in {} of {} reports\n", flags, count, surface_.size());
    }
    return text;
  }

  device::ReportSource& source() { return source_; }

 private:
  void Take(const device::SourceEvent& event) {
    if (event.kind == device::SourceEvent::Kind::kConnected) connected_ = true;
    if (event.kind != device::SourceEvent::Kind::kReport) return;
    const auto sample = decoder_.Decode(event.report, event.host_us);
    if (!sample) return;
    surface_.push_back(sample->surface_quality);
    shutter_.push_back(sample->shutter);
    ++flags_[sample->flags & ~protocol::kFlagMotion];
  }

  device::UsbSource source_;
  device::ReportDecoder decoder_;
  bool connected_ = false;
  std::vector<int> surface_, shutter_;
  std::map<int, int> flags_;
};

std::string Heading() {
  utsname machine{};
  uname(&machine);
  const std::time_t now = std::time(nullptr);
  char day[32];
  std::strftime(day, sizeof day, "%Y-%m-%d", std::gmtime(&now));
  return fmt::format("Torquer {}, {}; host {} {} {}\n", kVersion, day, machine.sysname,
                     machine.release, machine.machine);
}

const char* GoodOrBad(bool good) { return good ? "good" : "BAD"; }

std::string Ids(device::FeatureReports& reports, std::string* serial) {
  auto identity = device::GetReport<IdentityReport>(reports, protocol::kIdentityReportId);
  // After power-on the sensor starts within a second.
  for (int k = 0; k < 30 && (identity.self_test & 4) == 0; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    identity = device::GetReport<IdentityReport>(reports, protocol::kIdentityReportId);
  }
  *serial = std::string(identity.serial, strnlen(identity.serial, sizeof identity.serial));
  return fmt::format(
      "USB {:04x}:{:04x}, serial number {}\nfirmware {}.{}.{}, board {}, capabilities {:#04x}, "
      "crystal {} MHz, CPU {} MHz\n"
      "sensor: product {:#04x}, revision {:#04x}\n"
      "second sensor: {}\n"
      "self-test: application {}, settings {}, sensor {}\n",
      protocol::kUsbVendorId, protocol::kUsbProductId, *serial, identity.firmware_major,
      identity.firmware_minor, identity.firmware_patch, identity.board, identity.capabilities,
      identity.crystal_mhz, identity.cpu_mhz, identity.sensor_product_id, identity.sensor_revision,
      (identity.capabilities & protocol::kCapabilitySecondSensor) == 0
          ? "none"
          : fmt::format("product {:#04x}, {}", identity.second_product_id,
                        GoodOrBad(identity.self_test & 8)),
      GoodOrBad(identity.self_test & 1), GoodOrBad(identity.self_test & 2),
      GoodOrBad(identity.self_test & 4));
}

std::string Condition(device::FeatureReports& reports) {
  const auto configuration =
      device::GetReport<ConfigurationReport>(reports, protocol::kConfigurationReportId);
  const auto found = device::GetReport<DiagnosticsReport>(reports, protocol::kDiagnosticsReportId);
  return fmt::format(
      "configuration: {} counts an inch, dead zone {}\n"
      "reset_reason {:#04x}, srom_id {}, sensor_faults {}, sensor_resets {}, sensor_fault_cause "
      "{}, "
      "sensor_observation {:#04x}\n"
      "frames_missed {}, longest_frame_us {}, stack_headroom {}, settings_writes {}, joystick_rest "
      "{} {}, supply_mv {}\n",
      configuration.cpi, configuration.joystick_deadzone, found.reset_reason, found.srom_id,
      found.sensor_faults, found.sensor_resets, found.sensor_fault_cause, found.sensor_observation,
      found.frames_missed, found.longest_frame_us, found.stack_headroom, found.settings_writes,
      found.joystick_rest_x, found.joystick_rest_y, found.supply_mv);
}

std::string Fuses(const BoardReportRequest& request) {
  if (request.programmer.empty()) {
    return "not read: give --fuses PROGRAMMER with an ISP programmer on the chip\n";
  }
  const tools::Fuses fuses = tools::ReadFuses(request.programmer, request.port, {});
  std::string text = fmt::format("lfuse {:#04x}, hfuse {:#04x}, efuse {:#04x}, lock {:#04x}\n",
                                 fuses.low, fuses.high, fuses.extended, fuses.lock);
  for (const std::string& line : tools::JudgeFuses(fuses).lines) text += line + "\n";
  return text;
}

std::string Focus(Board& board) {
  device::SourceReports reports(board.source());
  std::vector<calibration::FocusPicture> pictures;
  int surface_quality = 0;
  for (int i = 0; i < kPictures; ++i) {
    board.Read(kBetweenUs);
    device::SensorPicture picture = device::TakeSensorPicture(reports);
    pictures.push_back(std::move(picture.pixels));
    surface_quality = picture.surface_quality;
  }
  return tools::FocusText(pictures.back(), false) +
         tools::FocusVerdictText(calibration::JudgeFocus(pictures, surface_quality),
                                 surface_quality);
}

std::string Calibration(const std::string& serial) {
  const std::string path = calibration::CalibrationPath(serial);
  std::ifstream file(path);
  if (!file) return path + ": " + std::strerror(errno) + "\n";
  return {std::istreambuf_iterator<char>(file), {}};
}

// A failed section does not affect the others.
template <class Make>
std::string Section(const char* title, Make make) {
  std::string text;
  try {
    text = make();
  } catch (const std::exception& error) {
    text = fmt::format("cannot be had: {}\n", error.what());
  }
  return fmt::format("\n## {}\n{}", title, text);
}

}  // namespace

std::string BoardReport(const BoardReportRequest& request) {
  std::string text = Heading();
  std::string serial = request.serial;
  {
    Board board(request.serial);
    device::SourceReports reports(board.source());
    text += Section("Ids", [&] { return Ids(reports, &serial); });
    text += Section("Fuses", [&] { return Fuses(request); });
  }
  text += Section("Rates and jitter", [&] {
    request.say(fmt::format("reading reports for {:.0f} s; leave the wire alone", request.seconds));
    return TimingReport(serial, request.seconds);
  });
  Board board(serial);
  device::SourceReports reports(board.source());
  text += Section("Surface", [&] {
    request.say(fmt::format("push and turn the wire slowly for {:.0f} s", request.seconds / 3));
    board.Forget();
    board.Read(static_cast<std::int64_t>(1e6 * request.seconds / 3));
    return board.Surface();
  });
  text += Section("Since its start", [&] { return Condition(reports); });
  text += Section("Camera", [&] {
    request.say("taking pictures; keep the wire moving slowly");
    return Focus(board);
  });
  text += Section("Calibration", [&] { return Calibration(serial); });
  return text;
}

}  // namespace torquer::hil
