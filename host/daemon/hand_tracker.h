// From samples to the wanted position of the instrument: absolute insertion, rotation and C-arm
// angles.
//
// Motion between two consecutive samples is applied unless one of them is in doubt (lift, poor
// surface, sensor fault) or has the clutch held. Motion that is not applied is dropped: the
// instrument stays and continues from there. The applied counts are summed as integers and
// converted at once, so that no rounding errors accumulate. No I/O, no clock.
#pragma once

#include <cstdint>
#include <optional>

#include "calibration/motion_model.h"
#include "host/device/report_decoder.h"

namespace torquer::daemon {

/// Absolute position of an instrument and of the C-arm.
struct Pose {
  double insertion_mm = 0.0;  ///< past the entry point since the start, positive distally
  double rotation_rad = 0.0;  ///< positive right-handed about the distal tangent
  double lao_rad = 0.0;       ///< -kLaoLimitRad .. kLaoLimitRad
  double cra_rad = 0.0;       ///< -kCraLimitRad .. kCraLimitRad
};

/// Travel of the C-arm: 90 degrees to each side, 45 degrees to head and feet.
inline constexpr double kLaoLimitRad = 1.5707963267948966;
inline constexpr double kCraLimitRad = 0.7853981633974483;

/// What the hand asks for.
struct HandState {
  Pose pose;
  bool xray = false;
  bool contrast = false;
  std::int32_t flags = 0;  ///< protocol::InstrumentFlag bits
};

/// Sums over all samples, counts.
struct TrackerCounters {
  std::int64_t axial_applied = 0;
  std::int64_t transverse_applied = 0;
  std::int64_t axial_held = 0;  ///< moved with the clutch held or in doubt
  std::int64_t transverse_held = 0;
};

class HandTracker {
 public:
  /// With a calibration, samples at another sensor resolution than its own are a sensor fault.
  /// Without one (nullopt) nominal gains hold for any resolution, and every state has the flag
  /// kCommandUncalibrated.
  HandTracker(const std::optional<calibration::Calibration>& calibration, const Pose& start);

  /// Takes the next sample, in order.
  HandState Step(const device::Sample& sample);

  /// What to publish while there is no device: the last pose, pedals up.
  HandState Hold() const;

  /// Makes the present position of the instrument its start, and sets the C-arm upright.
  void Home();

  const TrackerCounters& counters() const { return counters_; }

 private:
  std::int32_t Doubts(const device::Sample& sample);
  void Move(const device::Sample& sample, bool held);
  void TurnArm(const device::Sample& sample);
  void UseResolution(int cpi);
  Pose CurrentPose() const;

  bool calibrated_;
  calibration::Calibration calibration_;
  Pose base_;  // pose at which the applied counts below were 0
  std::int64_t axial_ = 0;
  std::int64_t transverse_ = 0;
  std::optional<device::Sample> last_;
  bool last_held_ = false;
  bool poor_surface_ = false;
  TrackerCounters counters_;
};

}  // namespace torquer::daemon
