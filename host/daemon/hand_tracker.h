// From samples to where the instrument is to be: absolute insertion, rotation and C-arm angles.
//
// Motion between two consecutive samples is applied when neither of them is in doubt (lift, poor
// surface, sensor fault) nor has the clutch held; otherwise it is held back for good, so that the
// instrument stays and goes on from there. The applied counts are kept as integers and converted
// as a whole: no rounding gathers, however many samples pass. No I/O, no clock.
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
  double lao_rad = 0.0;       ///< within kLaoLimitRad either way
  double cra_rad = 0.0;       ///< within kCraLimitRad either way
};

/// Travel of the C-arm: 90 degrees to each side, 45 degrees to head and feet.
inline constexpr double kLaoLimitRad = 1.5707963267948966;
inline constexpr double kCraLimitRad = 0.7853981633974483;

/// What the hand wants.
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
  /// With a calibration: samples must come at its sensor resolution, those at another are a sensor
  /// fault. Without one (nullopt): nominal gains for whatever resolution the samples have, and
  /// every state says so.
  HandTracker(const std::optional<calibration::Calibration>& calibration, const Pose& start);

  /// Takes in the next sample, in order.
  HandState Step(const device::Sample& sample);

  /// What to publish while there is no device: the last pose, pedals up.
  HandState Hold() const;

  /// The instrument's present place becomes its starting place, and the C-arm stands upright.
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
