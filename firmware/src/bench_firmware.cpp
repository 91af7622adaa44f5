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
constexpr uint8_t kSecondSensorGood = 1 << 3;

constexpr uint8_t kCapabilities = protocol::kCapabilityClosedAtRest | protocol::kCapabilitySupply;

constexpr uint8_t kButtonMask = protocol::kButtonXray | protocol::kButtonContrast |
                                protocol::kButtonClutch | protocol::kButtonStick;

}  // namespace

void BenchFirmware::Start() {
  settings_.Load();
  ReadSerialNumber(serial_);
  const uint8_t boot_id = NextBootId();
  report_.SetBootId(boot_id);
  second_report_.SetBootId(boot_id);
  sensor_.Start(settings_.cpi());
  if (second_ != nullptr) second_->Start(settings_.cpi());
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
    if (second_ != nullptr) second_->Sleep();
  } else {
    sensor_.Wake();
    if (second_ != nullptr) second_->Wake();
    joystick_.Start();
  }
}

// One pass of a suspended device: pressing a button wakes the host, if the host has allowed it.
void BenchFirmware::Doze() {
  sensor_.Maintain();
  if (second_ != nullptr) second_->Maintain();
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
  const bool second = second_ != nullptr && second_turn_;
  second_turn_ = !second;
  MotionSensor& sensor = second ? *second_ : sensor_;
  ReportBuilder& builder = second ? second_report_ : report_;
  sensor.BeginRead();
  joystick_.BeginFrame();
  const uint8_t pins = ReadContacts();
  const uint8_t held = buttons_.Update(pins);
  const MotionSample sample = sensor.Read();
  joystick_.EndFrame();
  builder.Count(sample);
  if (!second) {
    service_.Note(sample);
    reference_.Update(pins & board::kReferenceSwitch, held & board::kReferenceSwitch,
                      report_.axial_counts());
  }

  const ReferenceSwitch none;  // the end switch is the first sensor's
  const uint16_t deadzone = settings_.deadzone();
  const protocol::InputReport& report = builder.Next(
      sampled_us, held & kButtonMask, joystick_.x().Report(deadzone),
      joystick_.y().Report(deadzone), sensor.cpi(), second ? none : reference_, sensor.srom_lost());
  if (usb_.configured()) {
    usb_.SendInput(report);
    const uint32_t taken_us = board::NowUs() - frame_start_us_;
    if (taken_us > longest_frame_us_) {
      longest_frame_us_ = taken_us > UINT16_MAX ? UINT16_MAX : static_cast<uint16_t>(taken_us);
    }
  }

  // Does one of the longer jobs per frame: a control request, a byte of the settings, or the
  // sensor's upkeep. A host that sends requests without a pause does not block the other jobs.
  sensor.SetCpi(settings_.cpi());
  if (!usb_.Poll() || ++waived_frames_ >= kMostWaivedFrames) {
    waived_frames_ = 0;
    if (!settings_.Poll()) sensor.Maintain();
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
  const bool second = id == protocol::kSecondInputReportId && second_ != nullptr;
  if (id != protocol::kInputReportId && !second) return 0;
  memcpy(report, second ? &second_report_.newest() : &report_.newest(),
         sizeof(protocol::InputReport));
  return sizeof(protocol::InputReport);
}

uint8_t BenchFirmware::FillIdentity(protocol::IdentityReport& identity) const {
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
  identity.self_test = static_cast<uint8_t>((board::ApplicationIsWhole() ? kApplicationGood : 0) |
                                            (settings_.good() ? kSettingsGood : 0) |
                                            (sensor_.running() ? kSensorGood : 0));
  if (second_ != nullptr) {
    identity.capabilities |= protocol::kCapabilitySecondSensor;
    identity.second_product_id = second_->product_id();
    identity.second_revision = second_->revision();
    if (second_->running()) identity.self_test |= kSecondSensorGood;
  }
  return sizeof(identity);
}

uint8_t BenchFirmware::FillDiagnostics(protocol::DiagnosticsReport& diagnostics) const {
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
  if (second_ != nullptr) {
    diagnostics.second_faults = second_->restarts();
    diagnostics.second_resets = second_->self_resets();
    diagnostics.second_fault_cause = second_->fault_cause();
    diagnostics.second_observation = second_->observation();
  }
  return sizeof(diagnostics);
}

uint8_t BenchFirmware::GetFeatureReport(uint8_t id, uint8_t* report) {
  memset(report, 0, kCapacity);
  report[0] = id;
  report[1] = protocol::kProtocolVersion;
  switch (id) {
    case protocol::kIdentityReportId:
      return FillIdentity(*reinterpret_cast<protocol::IdentityReport*>(report));
    case protocol::kConfigurationReportId: {
      protocol::ConfigurationReport& configuration =
          *reinterpret_cast<protocol::ConfigurationReport*>(report);
      configuration.cpi = settings_.cpi();
      configuration.joystick_deadzone = settings_.deadzone();
      configuration.closed_at_rest = settings_.closed_at_rest();
      return sizeof(configuration);
    }
    case protocol::kDiagnosticsReportId:
      return FillDiagnostics(*reinterpret_cast<protocol::DiagnosticsReport*>(report));
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
        second_report_.Zero();
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
