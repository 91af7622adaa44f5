// Fills the input report, and keeps its cumulative counts.
#pragma once

#include <stdint.h>

#include "firmware/src/motion_sensor.h"
#include "firmware/src/reference_switch.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {

class ReportBuilder {
 public:
  /// `id` is that of the reports: one for each sensor.
  explicit ReportBuilder(protocol::ReportId id = protocol::kInputReportId) {
    report_.report_id = id;
  }
  void SetBootId(uint8_t boot_id) { report_.boot_id = boot_id; }
  /// Cumulative counts become zero.
  void Zero();

  /// Adds a reading to the counts. The sensor's board lies along the pipe, so that its light falls
  /// along the cylinder. Its y axis is along the wire, positive distally. Its x axis runs around
  /// the cylinder, against the right-handed sense.
  void Count(const MotionSample& sample);

  /// Makes the next report from the counts and their flags, and from the given values.
  const protocol::InputReport& Next(uint32_t device_time_us, uint8_t buttons, uint16_t joystick_x,
                                    uint16_t joystick_y, uint16_t cpi,
                                    const ReferenceSwitch& reference, bool srom_lost);

  int32_t axial_counts() const { return report_.axial_counts; }

  const protocol::InputReport& newest() const { return report_; }

 private:
  protocol::InputReport report_ = {};
};

}  // namespace firmware
}  // namespace torquer
