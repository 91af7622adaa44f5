#include "firmware/src/bench_firmware.h"

#include <string.h>

#include "firmware/board/board.h"
#include "firmware/src/boot_id.h"
#include "firmware/src/version.h"

namespace torquer {
namespace firmware {
namespace {

// Between accepting a command that restarts the device and doing so: the host sees its request
// acknowledged first.
constexpr uint32_t kCommandDelayUs = 10000;

// Bits of IdentityReport::self_test.
constexpr uint8_t kApplicationGood = 1 << 0;
constexpr uint8_t kSettingsGood = 1 << 1;
constexpr uint8_t kSensorGood = 1 << 2;

}  // namespace

void BenchFirmware::Start() {
  settings_.Load();
  ReadSerialNumber(serial_);
  report_.SetBootId(NextBootId());
  sensor_.Start(settings_.cpi());
  joystick_.Start();
}

void BenchFirmware::Step() {
  board::KickWatchdog();
  FollowBus();
  if (suspended_) {
    Doze();
  } else {
    usb_.Poll();
    uint32_t start_us = 0;
    if (board::TakeFrameStart(&start_us)) {
      Frame(start_us);
      usb_.Poll();
    }
  }
  RunPendingCommand();
}

void BenchFirmware::FollowBus() {
  const bool suspended = board::BusSuspended();
  if (suspended == suspended_) return;
  suspended_ = suspended;
  if (suspended) {
    sensor_.Sleep();
  } else {
    sensor_.Wake();
    joystick_.Start();
  }
}

// Of a suspended device: a button pressed now wakes the host, if that has allowed it.
void BenchFirmware::Doze() {
  sensor_.Maintain();
  const uint8_t held_before = buttons_.held();
  const uint8_t pressed =
      static_cast<uint8_t>(buttons_.Update(board::ReadButtons()) & ~held_before);
  if (pressed != 0 && usb_.may_wake_host()) board::WakeHost();
}

void BenchFirmware::Frame(uint32_t start_us) {
  joystick_.BeginFrame();
  const uint8_t held = buttons_.Update(board::ReadButtons());
  const uint32_t sampled_us = board::NowUs();
  const MotionSample sample = sensor_.Read();
  joystick_.EndFrame();

  const uint16_t deadzone = settings_.deadzone();
  const protocol::InputReport& report = report_.Next(
      sample, sampled_us, held, joystick_.x(deadzone), joystick_.y(deadzone), sensor_.cpi());
  if (usb_.configured()) {
    usb_.SendInput(report);
    const uint32_t taken_us = board::NowUs() - start_us;
    if (taken_us > longest_frame_us_) {
      longest_frame_us_ = taken_us > UINT16_MAX ? UINT16_MAX : static_cast<uint16_t>(taken_us);
    }
  }

  sensor_.SetCpi(settings_.cpi());
  sensor_.Maintain();
  settings_.Poll();
  stack_headroom_ = board::StackHeadroom();
}

void BenchFirmware::RunPendingCommand() {
  if (pending_command_ == 0) return;
  if (static_cast<int32_t>(board::NowUs() - command_at_us_) < 0) return;
  if (pending_command_ == protocol::kCommandEnterBootloader) board::EnterBootloader();
  board::Restart();
}

uint8_t BenchFirmware::GetInputReport(uint8_t id, uint8_t* report) {
  if (id != protocol::kInputReportId) return 0;
  memcpy(report, &report_.newest(), sizeof(protocol::InputReport));
  return sizeof(protocol::InputReport);
}

uint8_t BenchFirmware::GetFeatureReport(uint8_t id, uint8_t* report) {
  memset(report, 0, kCapacity);
  report[0] = id;
  report[1] = protocol::kProtocolVersion;
  switch (id) {
    case protocol::kIdentityReportId: {
      protocol::IdentityReport& identity = *reinterpret_cast<protocol::IdentityReport*>(report);
      identity.firmware_major = kVersionMajor;
      identity.firmware_minor = kVersionMinor;
      identity.firmware_patch = kVersionPatch;
      identity.sensor_product_id = sensor_.product_id();
      identity.sensor_revision = sensor_.revision();
      identity.clock_mhz = board::ClockMhz();
      memcpy(identity.serial, serial_, kSerialBytes);
      identity.self_test = static_cast<uint8_t>(
          (board::ApplicationIsWhole() ? kApplicationGood : 0) |
          (settings_.good() ? kSettingsGood : 0) | (sensor_.running() ? kSensorGood : 0));
      return sizeof(identity);
    }
    case protocol::kConfigurationReportId: {
      protocol::ConfigurationReport& configuration =
          *reinterpret_cast<protocol::ConfigurationReport*>(report);
      configuration.cpi = settings_.cpi();
      configuration.joystick_deadzone = settings_.deadzone();
      return sizeof(configuration);
    }
    case protocol::kDiagnosticsReportId: {
      protocol::DiagnosticsReport& diagnostics =
          *reinterpret_cast<protocol::DiagnosticsReport*>(report);
      diagnostics.reset_reason = board::ResetReason();
      diagnostics.srom_id = sensor_.srom_id();
      diagnostics.sensor_faults = sensor_.restarts();
      diagnostics.frames_missed = usb_.frames_missed();
      diagnostics.settings_writes = settings_.writes();
      diagnostics.stack_headroom = stack_headroom_;
      diagnostics.longest_frame_us = longest_frame_us_;
      return sizeof(diagnostics);
    }
    default:
      return 0;
  }
}

bool BenchFirmware::SetFeatureReport(const uint8_t* report, uint8_t size) {
  if (report[0] == protocol::kConfigurationReportId) {
    if (size != sizeof(protocol::ConfigurationReport)) return false;
    const protocol::ConfigurationReport& configuration =
        *reinterpret_cast<const protocol::ConfigurationReport*>(report);
    return configuration.protocol_version == protocol::kProtocolVersion &&
           settings_.Set(configuration.cpi, configuration.joystick_deadzone);
  }
  if (report[0] == protocol::kCommandReportId) {
    if (size != sizeof(protocol::CommandReport)) return false;
    const protocol::CommandReport& command =
        *reinterpret_cast<const protocol::CommandReport*>(report);
    if (command.key != protocol::kCommandKey) return false;
    switch (command.command) {
      case protocol::kCommandZero:
        report_.Zero();
        return true;
      case protocol::kCommandEnterBootloader:
      case protocol::kCommandReset:
        pending_command_ = command.command;
        command_at_us_ = board::NowUs() + kCommandDelayUs;
        return true;
      default:
        return false;
    }
  }
  return false;
}

}  // namespace firmware
}  // namespace torquer
