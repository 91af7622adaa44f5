#include "host/daemon/hand_tracker.h"

#include <algorithm>

#include "protocol/lcm_channels.h"

namespace torquer::daemon {
namespace {

// Surface quality (features / 8) below which motion is in doubt, and from which it is trusted
// again.
constexpr int kPoorSurface = 10;
constexpr int kGoodSurface = 16;

// A joystick reading holds no longer than this: after that the position of the stick is unknown.
constexpr std::int64_t kLongestHoldUs = 50000;

}  // namespace

HandTracker::HandTracker(const std::optional<calibration::Calibration>& calibration,
                         const Pose& start)
    : calibrated_(calibration.has_value()),
      calibration_(
          calibration.value_or(calibration::NominalCalibration("", calibration::kNominalCpi))),
      base_(start) {}

HandState HandTracker::Step(const device::Sample& sample) {
  if (!calibrated_ && sample.cpi > 0) UseResolution(sample.cpi);
  HandState state;
  state.flags = Doubts(sample);
  const bool held = state.flags != 0;
  Move(sample, held);
  TurnArm(sample);
  last_ = sample;
  last_held_ = held;

  if (!calibrated_) state.flags |= protocol::kCommandUncalibrated;
  state.pose = CurrentPose();
  state.xray = (sample.buttons & protocol::kButtonXray) != 0;
  state.contrast = (sample.buttons & protocol::kButtonContrast) != 0;
  return state;
}

HandState HandTracker::Hold() const {
  HandState state;
  state.pose = CurrentPose();
  state.flags = protocol::kCommandNoDevice | (calibrated_ ? 0 : protocol::kCommandUncalibrated);
  return state;
}

void HandTracker::Home() {
  base_ = {};
  axial_ = 0;
  transverse_ = 0;
}

std::int32_t HandTracker::Doubts(const device::Sample& sample) {
  std::int32_t doubts = 0;
  poor_surface_ = sample.surface_quality < (poor_surface_ ? kGoodSurface : kPoorSurface);
  if ((sample.flags & protocol::kFlagLift) != 0 || poor_surface_) doubts |= protocol::kCommandLift;
  if ((sample.flags & protocol::kFlagSensorFault) != 0 || sample.cpi != calibration_.motion.cpi) {
    doubts |= protocol::kCommandSensorFault;
  }
  if ((sample.buttons & protocol::kButtonClutch) != 0) doubts |= protocol::kCommandClutch;
  return doubts;
}

void HandTracker::Move(const device::Sample& sample, bool held) {
  if (!last_ || sample.epoch_start != device::EpochStart::kNone) return;
  const std::int64_t axial = sample.axial_counts - last_->axial_counts;
  const std::int64_t transverse = sample.transverse_counts - last_->transverse_counts;
  if (held || last_held_) {
    counters_.axial_held += axial;
    counters_.transverse_held += transverse;
    return;
  }
  axial_ += axial;
  transverse_ += transverse;
  counters_.axial_applied += axial;
  counters_.transverse_applied += transverse;
}

void HandTracker::TurnArm(const device::Sample& sample) {
  if (!last_ || sample.epoch_start != device::EpochStart::kNone) return;
  const std::int64_t passed_us =
      std::clamp<std::int64_t>(sample.device_time_us - last_->device_time_us, 0, kLongestHoldUs);
  const double passed_s = 1e-6 * static_cast<double>(passed_us);
  const auto turned = [&](double angle, const calibration::JoystickAxis& axis, double counts,
                          double limit) {
    return std::clamp(angle + calibration::Rate(axis, counts) * passed_s, -limit, limit);
  };
  base_.lao_rad = turned(base_.lao_rad, calibration_.lao, sample.joystick_x, kLaoLimitRad);
  base_.cra_rad = turned(base_.cra_rad, calibration_.cra, sample.joystick_y, kCraLimitRad);
}

// Nominal gains follow the sensor's resolution; the pose so far is kept.
void HandTracker::UseResolution(int cpi) {
  if (cpi == calibration_.motion.cpi) return;
  base_ = CurrentPose();
  axial_ = 0;
  transverse_ = 0;
  calibration_ = calibration::NominalCalibration("", cpi);
}

Pose HandTracker::CurrentPose() const {
  const calibration::HandMotion motion =
      calibration::Apply(calibration_.motion, axial_, transverse_);
  Pose pose = base_;
  pose.insertion_mm += motion.insertion_mm;
  pose.rotation_rad += motion.rotation_rad;
  return pose;
}

}  // namespace torquer::daemon
