// Fills the input report, and keeps what is cumulative in it.
#pragma once

#include <stdint.h>

#include "firmware/src/motion_sensor.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

class ReportBuilder {
 public:
  void SetBootId(uint8_t boot_id) { report_.boot_id = boot_id; }
  /// Cumulative counts become zero.
  void Zero();

  /// The next report. The sensor is mounted with x along the wire (positive distally) and y around
  /// it (positive right-handed), so its axes are the report's.
  const protocol::InputReport& Next(const MotionSample& sample, uint32_t device_time_us,
                                    uint8_t buttons, uint16_t joystick_x, uint16_t joystick_y,
                                    uint16_t cpi);

  const protocol::InputReport& newest() const { return report_; }

 private:
  protocol::InputReport report_ = {};
};

}  // namespace firmware
}  // namespace torquer
