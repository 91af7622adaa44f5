#include "firmware/src/report.h"

namespace torquer {
namespace firmware {
namespace {

// The sum may wrap, which C++ defines for unsigned numbers only.
int32_t Add(int32_t total, int32_t delta) {
  return static_cast<int32_t>(static_cast<uint32_t>(total) + static_cast<uint32_t>(delta));
}

}  // namespace

void ReportBuilder::Zero() {
  report_.axial_counts = 0;
  report_.transverse_counts = 0;
}

void ReportBuilder::Count(const MotionSample& sample) {
  report_.flags = static_cast<uint8_t>((sample.motion ? protocol::kFlagMotion : 0) |
                                       (sample.lifted ? protocol::kFlagLift : 0) |
                                       (sample.fault ? protocol::kFlagSensorFault : 0));
  report_.axial_counts = Add(report_.axial_counts, sample.delta_y);
  report_.transverse_counts = Add(report_.transverse_counts, -static_cast<int32_t>(sample.delta_x));
  report_.surface_quality = sample.surface_quality;
  report_.shutter = sample.shutter;
}

const protocol::InputReport& ReportBuilder::Next(uint32_t device_time_us, uint8_t buttons,
                                                 uint16_t joystick_x, uint16_t joystick_y,
                                                 uint16_t cpi, const ReferenceSwitch& reference,
                                                 bool srom_lost) {
  report_.protocol_version = protocol::kProtocolVersion;
  report_.flags =
      static_cast<uint8_t>(report_.flags | (reference.passed() ? protocol::kFlagReference : 0) |
                           (reference.closed() ? protocol::kFlagAtReference : 0) |
                           (srom_lost ? protocol::kFlagSromLost : 0));
  report_.buttons = buttons;
  report_.sequence = static_cast<uint16_t>(report_.sequence + 1);
  report_.device_time_us = device_time_us;
  report_.joystick_x = joystick_x;
  report_.joystick_y = joystick_y;
  report_.cpi = cpi;
  report_.reference_counts = reference.counts();
  return report_;
}

}  // namespace firmware
}  // namespace torquer
