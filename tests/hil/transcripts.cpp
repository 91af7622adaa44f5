#include "tests/hil/transcripts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <vector>

#include "protocol/hid_descriptor.h"

namespace torquer::hil {
namespace {

using protocol::ConfigurationReport;
using protocol::DiagnosticsReport;
using protocol::IdentityReport;
using protocol::InputReport;

std::string StringOf(Program& program, std::uint8_t index) {
  unsigned char text[128];
  const int size = libusb_get_string_descriptor_ascii(program.handle(), index, text, sizeof(text));
  REQUIRE(size >= 0);
  return {reinterpret_cast<char*>(text), static_cast<std::size_t>(size)};
}

// Discards old reports in the endpoint's banks first. Of two sensors, it is the first one's.
InputReport FreshReport(Program& program) {
  for (int i = 0; i < 4; ++i) program.ReadReport();
  const InputReport report = program.ReadReport();
  return report.report_id == protocol::kInputReportId ? report : program.ReadReport();
}

bool HasTwoSensors(Program& program) {
  return (program.Get<IdentityReport>(protocol::kIdentityReportId).capabilities &
          protocol::kCapabilitySecondSensor) != 0;
}

ConfigurationReport Configuration(Program& program) {
  return program.Get<ConfigurationReport>(protocol::kConfigurationReportId);
}

void Restart(Program& program) {
  protocol::CommandReport command{
      protocol::kCommandReportId, protocol::kCommandReset, protocol::kCommandKey, {}};
  REQUIRE(program.Set(command) == sizeof(command));
  // Reads until the device has left the bus.
  std::vector<unsigned char> packet;
  int result = 0;
  for (int i = 0; i < 5000 && result == 0; ++i) result = program.ReadInput(&packet);
  CHECK(result != 0);
  program.OpenAgain();
}

}  // namespace

void DescribesItself(Program& program) {
  libusb_device_descriptor descriptor;
  REQUIRE(libusb_get_device_descriptor(libusb_get_device(program.handle()), &descriptor) == 0);
  CHECK(descriptor.bMaxPacketSize0 == protocol::kControlPacketBytes);
  CHECK(StringOf(program, descriptor.iManufacturer) == protocol::kUsbManufacturer);
  CHECK(StringOf(program, descriptor.iProduct) == protocol::kUsbProduct);

  const auto identity = program.Get<IdentityReport>(protocol::kIdentityReportId);
  CHECK(identity.protocol_version == protocol::kProtocolVersion);
  CHECK((identity.crystal_mhz == 8 || identity.crystal_mhz == 16));
  CHECK((identity.cpu_mhz == 8 || identity.cpu_mhz == 16));
  const std::string serial(identity.serial, strnlen(identity.serial, sizeof(identity.serial)));
  CHECK_FALSE(serial.empty());
  CHECK(StringOf(program, descriptor.iSerialNumber) == serial);
  CHECK(descriptor.bcdDevice == ((identity.firmware_major << 8) | (identity.firmware_minor << 4) |
                                 identity.firmware_patch));

  unsigned char bytes[256];
  const int size = libusb_control_transfer(program.handle(), 0x81, 6, 0x2200, 0, bytes,
                                           sizeof(bytes), kTimeoutMs);
  REQUIRE(size == sizeof(protocol::kHidReportDescriptor));
  CHECK(std::memcmp(bytes, protocol::kHidReportDescriptor,
                    sizeof(protocol::kHidReportDescriptor)) == 0);
}

void SendsEveryFrame(Program& program, int reports, int may_miss) {
  const int sensors = HasTwoSensors(program) ? 2 : 1;
  const InputReport first = FreshReport(program);
  std::map<int, InputReport> last;  // by report id: the sensors take turns
  int missing = 0;
  for (int i = 0; i < reports; ++i) {
    const InputReport report = program.ReadReport();
    REQUIRE((report.report_id == protocol::kInputReportId ||
             (sensors == 2 && report.report_id == protocol::kSecondInputReportId)));
    REQUIRE(report.protocol_version == protocol::kProtocolVersion);
    REQUIRE(report.boot_id == first.boot_id);
    REQUIRE(report.joystick_x <= protocol::kJoystickMax);
    REQUIRE(report.joystick_y <= protocol::kJoystickMax);
    if (const auto before = last.find(report.report_id); before != last.end()) {
      const auto ahead = static_cast<std::uint16_t>(report.sequence - before->second.sequence);
      REQUIRE(ahead >= 1);
      REQUIRE(ahead < 0x8000);
      missing += ahead - 1;
      const double step_us = static_cast<double>(
          static_cast<std::uint32_t>(report.device_time_us - before->second.device_time_us));
      REQUIRE(step_us > 900.0 * ahead * sensors);
      REQUIRE(step_us < 1100.0 * ahead * sensors);
    }
    last[report.report_id] = report;
  }
  CHECK(static_cast<int>(last.size()) == sensors);
  CHECK(missing <= may_miss * reports / 1000);
}

void KeepsItsConfiguration(Program& program) {
  const ConfigurationReport before = Configuration(program);
  ConfigurationReport other = before;
  other.joystick_deadzone = static_cast<std::uint16_t>(before.joystick_deadzone == 37 ? 38 : 37);
  REQUIRE(program.Set(other) == sizeof(other));
  CHECK(Configuration(program).joystick_deadzone == other.joystick_deadzone);
  for (int i = 0; i < 200; ++i) program.ReadReport();  // during the EEPROM write
  Restart(program);
  CHECK(Configuration(program).joystick_deadzone == other.joystick_deadzone);

  const ConfigurationReport senseless[] = {
      {other.report_id, std::uint8_t(other.protocol_version + 1), other.cpi, 37, 0, {}},
      {other.report_id, other.protocol_version, 0, 37, 0, {}},
      {other.report_id, other.protocol_version, 12100, 37, 0, {}},
      {other.report_id, other.protocol_version, other.cpi, 512, 0, {}},
      {other.report_id, other.protocol_version, other.cpi, 37, 8, {}},
  };
  for (const ConfigurationReport& report : senseless) {
    CHECK(program.Set(report) == LIBUSB_ERROR_PIPE);
    CHECK(Configuration(program).cpi == before.cpi);
  }
  CHECK(program.SetFeature({protocol::kConfigurationReportId, protocol::kProtocolVersion}) ==
        LIBUSB_ERROR_PIPE);
  REQUIRE(program.Set(before) == sizeof(before));
  for (int i = 0; i < 200; ++i) program.ReadReport();
}

void RefusesNonsense(Program& program) {
  struct Request {
    std::uint8_t type, request;
    std::uint16_t value, index, length;
  };
  const Request requests[] = {
      {0x80, 6, 0x0600, 0, 10},      // device qualifier of a full-speed device
      {0x80, 6, 0x0304, 0x409, 9},   // string without a text
      {0xa1, 1, 0x0304 + 1, 0, 64},  // command, which cannot be read
      {0xa1, 1, 0x0377, 0, 64},      // an unknown report
      {0xa1, 1, 0x0203, 0, 64},      // an output report
      {0xa1, 3, 0, 0, 1},            // GET_PROTOCOL, without a boot interface
      {0xc0, 0x55, 1, 2, 8},         // a vendor's request
      {0x82, 0, 0, 0x85, 2},         // the status of an unknown endpoint
  };
  std::array<unsigned char, 64> bytes{};
  for (const Request& request : requests) {
    INFO("bmRequestType " << int(request.type) << " bRequest " << int(request.request));
    CHECK(libusb_control_transfer(program.handle(), request.type, request.request, request.value,
                                  request.index, bytes.data(), request.length,
                                  kTimeoutMs) == LIBUSB_ERROR_PIPE);
    program.Get<IdentityReport>(protocol::kIdentityReportId);
  }
}

void HaltsAndGoesOn(Program& program) {
  REQUIRE(libusb_control_transfer(program.handle(), 0x02, 3, 0, kInput, nullptr, 0, kTimeoutMs) ==
          0);
  std::vector<unsigned char> packet;
  CHECK(program.ReadInput(&packet) == LIBUSB_ERROR_PIPE);
  CHECK(program.ReadInput(&packet) == LIBUSB_ERROR_PIPE);
  unsigned char status[2] = {};
  REQUIRE(libusb_control_transfer(program.handle(), 0x82, 0, 0, kInput, status, 2, kTimeoutMs) ==
          2);
  CHECK(status[0] == 1);
  REQUIRE(libusb_clear_halt(program.handle(), kInput) == 0);
  program.ReadReport();
}

void OutlivesGivenUpTransfers(Program& program) {
  const auto before = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  std::mt19937 random(4);
  for (int round = 0; round < 20; ++round) {
    libusb_transfer* transfer = libusb_alloc_transfer(0);
    std::array<unsigned char, LIBUSB_CONTROL_SETUP_SIZE + 64> bytes{};
    int over = 0;
    const auto done = +[](libusb_transfer* ended) { *static_cast<int*>(ended->user_data) = 1; };
    if (round % 2 == 0) {
      libusb_fill_control_setup(bytes.data(), 0xa1, 1, 0x0300 | protocol::kIdentityReportId, 0, 64);
      libusb_fill_control_transfer(transfer, program.handle(), bytes.data(), done, &over,
                                   kTimeoutMs);
    } else {
      libusb_fill_interrupt_transfer(transfer, program.handle(), kInput, bytes.data(), 32, done,
                                     &over, kTimeoutMs);
    }
    REQUIRE(libusb_submit_transfer(transfer) == 0);
    if (random() % 2) std::this_thread::sleep_for(std::chrono::microseconds(random() % 1500));
    libusb_cancel_transfer(transfer);
    for (int i = 0; i < 10000 && over == 0; ++i) {
      timeval step{0, 10000};
      libusb_handle_events_timeout_completed(program.context(), &step, &over);
    }
    REQUIRE(over == 1);
    libusb_free_transfer(transfer);
    program.ReadReport();
  }
  const auto after = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(after.reset_reason == before.reset_reason);
  CHECK(after.sensor_faults == before.sensor_faults);
}

void RestartsByItsWatchdog(Program& program) {
  const InputReport before = FreshReport(program);
  Restart(program);
  const InputReport after = FreshReport(program);
  CHECK(after.boot_id != before.boot_id);
  CHECK(after.device_time_us < 60000000);
  CHECK(after.sequence < 60000);
  const auto diagnostics = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.reset_reason == 8);
}

void IsInGoodHealth(Program& program) {
  InputReport report = program.ReadReport();
  for (int i = 0; i < 400; ++i) report = program.ReadReport();  // time for the stack scan
  for (int i = 0; i < 3000 && (report.flags & protocol::kFlagSensorFault); ++i) {
    report = program.ReadReport();
  }
  CHECK((report.flags & protocol::kFlagSensorFault) == 0);
  const auto identity = program.Get<IdentityReport>(protocol::kIdentityReportId);
  CHECK((identity.sensor_product_id == 0x42 || identity.sensor_product_id == 0x47));
  CHECK(identity.self_test == (HasTwoSensors(program) ? 15 : 7));
  const auto diagnostics = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.sensor_faults == 0);
  CHECK(diagnostics.stack_headroom > 512);
  CHECK(diagnostics.longest_frame_us > 0);
  CHECK(diagnostics.longest_frame_us < 1000);
}

void ServesRowsOfRequests(Program& program, int rounds) {
  const ConfigurationReport kept = Configuration(program);
  const auto before = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  for (int round = 0; round < rounds; ++round) {
    program.Get<IdentityReport>(protocol::kIdentityReportId);
    REQUIRE(program.Set(kept) == sizeof(kept));
    REQUIRE(program.Set(kept) == sizeof(kept));
    program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
    program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  }
  const auto after = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(after.settings_writes == before.settings_writes);
  CHECK(after.reset_reason == before.reset_reason);
  program.ReadReport();
}

void RestsWithoutFault(Program& program, int reports) {
  const auto before = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  int faults = 0;
  for (int i = 0; i < reports; ++i) {
    faults += (program.ReadReport().flags & protocol::kFlagSensorFault) != 0 ? 1 : 0;
  }
  CHECK(faults == 0);
  const auto after = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(after.sensor_faults == before.sensor_faults);
  CHECK(after.sensor_resets == before.sensor_resets);
}

void RunsWithoutAnImage(Program& program) {
  Restart(program);
  InputReport report = program.ReadReport();
  for (int i = 0; i < 3000 && (report.flags & protocol::kFlagSensorFault) != 0; ++i) {
    report = program.ReadReport();
  }
  REQUIRE((report.flags & protocol::kFlagSensorFault) == 0);
  const auto diagnostics = program.Get<DiagnosticsReport>(protocol::kDiagnosticsReportId);
  CHECK(diagnostics.srom_id == 0);
  CHECK(diagnostics.sensor_faults == 0);
  for (int i = 0; i < 200; ++i) report = program.ReadReport();
  CHECK((report.flags & (protocol::kFlagSensorFault | protocol::kFlagLift)) == 0);
  CHECK(report.surface_quality >= 16);
}

double LeastShareOfMotion(Program& program, int reports) {
  // The firmware's five checks: every 32 frames, and the first again one frame after the last.
  constexpr std::size_t kCycle = 129, kBetween = 32, kChecks = 5;
  constexpr double kLeastCounts = 1;  // a frame, on average
  std::array<double, kCycle> counts{};
  std::array<double, kCycle> frames{};
  InputReport last = FreshReport(program);
  std::size_t frame = 0;
  for (int i = 0; i < reports; ++i) {
    const InputReport report = program.ReadReport();
    if (report.report_id != protocol::kInputReportId) continue;
    const auto ahead = static_cast<std::uint16_t>(report.sequence - last.sequence);
    frame = (frame + ahead) % kCycle;
    if (ahead == 1) {
      counts[frame] += std::abs(static_cast<double>(report.axial_counts) - last.axial_counts);
      ++frames[frame];
    }
    last = report;
  }
  const double mean = std::accumulate(counts.begin(), counts.end(), 0.0) /
                      std::accumulate(frames.begin(), frames.end(), 0.0);
  INFO("push the wire faster");
  REQUIRE(mean >= kLeastCounts);
  double least = 1e9;
  for (std::size_t first = 0; first < kCycle; ++first) {
    double in_checks = 0, checks = 0;
    for (std::size_t check = 0; check < kChecks; ++check) {
      in_checks += counts[(first + kBetween * check) % kCycle];
      checks += frames[(first + kBetween * check) % kCycle];
    }
    least = std::min(least, in_checks / checks / mean);
  }
  return least;
}

calibration::FocusFigures LampFigures(Program& program) {
  protocol::PictureReport picture{};
  REQUIRE(libusb_control_transfer(program.handle(), 0xa1, 1, 0x0300 | protocol::kPictureReportId, 0,
                                  reinterpret_cast<unsigned char*>(&picture), sizeof(picture),
                                  kTimeoutMs) == sizeof(picture));
  const calibration::FocusPicture pixels(std::begin(picture.pixels), std::end(picture.pixels));
  return calibration::MeasureFocus({&pixels, 1});
}

}  // namespace torquer::hil
