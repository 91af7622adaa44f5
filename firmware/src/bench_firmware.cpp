#include "firmware/src/bench_firmware.h"

#include <string.h>

#include "firmware/board/board.h"
#include "firmware/src/boot_id.h"
#include "firmware/src/version.h"
#include "protocol/firmware_image.h"

namespace torquer {
namespace firmware {
namespace {

// Delay between a restart command and the restart, so that the host first sees the acknowledgment.
constexpr uint32_t kCommandDelayUs = 10000;

constexpr uint16_t kFrameUs = 1000;
// Time from the start of each frame during which endpoint 0 is served.
constexpr uint16_t kControlWindowUs = 500;
constexpr uint8_t kMostWaivedFrames = 8;

// Bits of IdentityReport::self_test.
constexpr uint8_t kApplicationGood = 1 << 0;
constexpr uint8_t kSettingsGood = 1 << 1;
constexpr uint8_t kSensorGood = 1 << 2;

constexpr uint8_t kCapabilities = protocol::kCapabilityClosedAtRest | protocol::kCapabilitySupply;

constexpr uint8_t kButtonMask =
    protocol::kButtonXray | protocol::kButtonContrast | protocol::kButtonClutch;

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
    if (board::TakeFrameStart(&frame_start_us_)) Frame();
    ServeControl();
    if (service_.Run()) Stream();
  }
  RunPendingCommand();
}

// Control requests late in a frame wait for the next frame, which must not begin late.
void BenchFirmware::ServeControl() {
  const uint32_t since_us = board::NowUs() - frame_start_us_;
  if (since_us >= kControlWindowUs && since_us < kFrameUs) {
    usb_.Hold();
  } else {
    usb_.Poll();
  }
}

// While a firmware image passes from the host to the sensor, the device does no other work and
// skips frames.
void BenchFirmware::Stream() {
  do {
    board::KickWatchdog();
    if (usb_.RequestPending()) usb_.Poll();
  } while (service_.Run());
}

void BenchFirmware::FollowBus() {
  const bool suspended = board::BusSuspended();
  if (suspended == suspended_) return;
  suspended_ = suspended;
  if (suspended) {
    service_.Abandon();
    sensor_.Sleep();
  } else {
    sensor_.Wake();
    joystick_.Start();
  }
}

// One pass of a suspended device: pressing a button wakes the host, if the host has allowed it.
void BenchFirmware::Doze() {
  sensor_.Maintain();
  const uint8_t held_before = buttons_.held();
  const uint8_t held = buttons_.Update(ReadContacts(), Buttons::kStableReadingsSuspended);
  const uint8_t pressed = static_cast<uint8_t>(held & ~held_before & kButtonMask);
  if (pressed != 0 && usb_.may_wake_host()) board::WakeHost();
}

// A contact that is closed at rest is pressed while it is open.
uint8_t BenchFirmware::ReadContacts() const {
  return board::ReadButtons() ^ settings_.closed_at_rest();
}

void BenchFirmware::Frame() {
  const uint32_t sampled_us = board::NowUs();
  sensor_.BeginRead();
  joystick_.BeginFrame();
  const uint8_t pins = ReadContacts();
  const uint8_t held = buttons_.Update(pins);
  const MotionSample sample = sensor_.Read();
  joystick_.EndFrame();
  service_.Note(sample);
  report_.Count(sample);
  reference_.Update(pins & board::kReferenceSwitch, held & board::kReferenceSwitch,
                    report_.axial_counts());

  const uint16_t deadzone = settings_.deadzone();
  const protocol::InputReport& report =
      report_.Next(sampled_us, held & kButtonMask, joystick_.x().Report(deadzone),
                   joystick_.y().Report(deadzone), sensor_.cpi(), reference_, sensor_.srom_lost());
  if (usb_.configured()) {
    usb_.SendInput(report);
    const uint32_t taken_us = board::NowUs() - frame_start_us_;
    if (taken_us > longest_frame_us_) {
      longest_frame_us_ = taken_us > UINT16_MAX ? UINT16_MAX : static_cast<uint16_t>(taken_us);
    }
  }

  // Does one of the longer jobs per frame: a control request, a byte of the settings, or the
  // sensor's upkeep. A host that sends requests without a pause does not block the other jobs.
  sensor_.SetCpi(settings_.cpi());
  if (!usb_.Poll() || ++waived_frames_ >= kMostWaivedFrames) {
    waived_frames_ = 0;
    if (!settings_.Poll()) sensor_.Maintain();
  }
  stack_headroom_ = board::StackHeadroom();
}

void BenchFirmware::RunPendingCommand() {
  if (pending_command_ == 0) return;
  if (static_cast<int32_t>(board::NowUs() - command_at_us_) < 0) return;
  // The host relies on stored settings. Storing them takes at most two writes of about 40 ms.
  if (!settings_.kept()) {
    settings_.Poll();
    return;
  }
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
      identity.crystal_mhz = protocol::CrystalMhz(board::ClockCode());
      identity.cpu_mhz = protocol::CpuMhz(board::ClockCode());
      identity.board = board::Board();
      identity.capabilities = static_cast<uint8_t>(kCapabilities | service_.capabilities());
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
      configuration.closed_at_rest = settings_.closed_at_rest();
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
      diagnostics.sensor_resets = sensor_.self_resets();
      diagnostics.sensor_fault_cause = sensor_.fault_cause();
      diagnostics.sensor_observation = sensor_.observation();
      diagnostics.joystick_rest_x = joystick_.x().rest();
      diagnostics.joystick_rest_y = joystick_.y().rest();
      diagnostics.supply_mv = joystick_.supply_mv();
      return sizeof(diagnostics);
    }
    default:
      return 0;
  }
}

bool BenchFirmware::SetFeatureReport(const uint8_t* report, uint8_t size) {
  if (report[0] == protocol::kConfigurationReportId) {
    if (size < sizeof(protocol::ConfigurationReport)) return false;
    const protocol::ConfigurationReport& configuration =
        *reinterpret_cast<const protocol::ConfigurationReport*>(report);
    return configuration.protocol_version == protocol::kProtocolVersion &&
           settings_.Set(configuration.cpi, configuration.joystick_deadzone,
                         configuration.closed_at_rest);
  }
  if (report[0] == protocol::kCommandReportId) {
    if (size < sizeof(protocol::CommandReport)) return false;
    const protocol::CommandReport& command =
        *reinterpret_cast<const protocol::CommandReport*>(report);
    if (command.key != protocol::kCommandKey) return false;
    switch (command.command) {
      case protocol::kCommandZero:
        reference_.Shift(report_.axial_counts());
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
