#include "host/daemon/hand_tracker.h"

#include <algorithm>
#include <cmath>

#include "protocol/lcm_channels.h"

namespace torquer::daemon {
namespace {

// Thresholds of surface quality (features / 8). Below the first, motion is in doubt; from the
// second on, it is trusted again.
constexpr int kPoorSurface = 10;
constexpr int kGoodSurface = 16;

// Longest time in us for which a joystick reading is valid; after that the position of the stick is
// unknown.
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
  ChooseStick(sample);
  UseStick(sample);
  state.mark = PassMark(sample);
  if (!held) Heal(sample);
  last_ = sample;
  last_held_ = held;

  if (!calibrated_) state.flags |= protocol::kCommandUncalibrated;
  if (stick_ == Stick::kTable) state.flags |= protocol::kCommandStickTable;
  if (stick_ == Stick::kHeight) state.flags |= protocol::kCommandStickHeight;
  state.pose = CurrentPose();
  state.start = start_;
  state.joystick_x = sample.joystick_x;
  state.joystick_y = sample.joystick_y;
  state.xray = (sample.buttons & protocol::kButtonXray) != 0;
  state.contrast = (sample.buttons & protocol::kButtonContrast) != 0;
  return state;
}

HandState HandTracker::Hold() const {
  HandState state;
  state.pose = CurrentPose();
  state.start = start_;
  state.flags = protocol::kCommandNoDevice | (calibrated_ ? 0 : protocol::kCommandUncalibrated);
  return state;
}

void HandTracker::Home() {
  ++start_;
  base_ = {};
  axial_ = 0;
  transverse_ = 0;
  to_heal_mm_ = 0.0;  // it is from the motion before the new start
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
    // With the clutch held, the hand's travel is still counted. Motion in doubt is lost until the
    // next closing of the end switch.
    if (((sample.buttons | last_->buttons) & protocol::kButtonClutch) != 0) {
      travel_axial_ += axial;
      travel_transverse_ += transverse;
    }
    return;
  }
  travel_axial_ += axial;
  travel_transverse_ += transverse;
  axial_ += axial;
  transverse_ += transverse;
  counters_.axial_applied += axial;
  counters_.transverse_applied += transverse;
}

// Each press gives the joystick to the next one.
void HandTracker::ChooseStick(const device::Sample& sample) {
  if (!last_ || sample.epoch_start != device::EpochStart::kNone) return;
  if ((sample.buttons & ~last_->buttons & protocol::kButtonStick) == 0) return;
  stick_ = stick_ == Stick::kArm     ? Stick::kTable
           : stick_ == Stick::kTable ? Stick::kHeight
                                     : Stick::kArm;
}

void HandTracker::UseStick(const device::Sample& sample) {
  if (!last_ || sample.epoch_start != device::EpochStart::kNone) return;
  const double passed_s = PassedS(sample);
  const double x_rad = calibration::Rate(calibration_.lao, sample.joystick_x) * passed_s;
  const double y_rad = calibration::Rate(calibration_.cra, sample.joystick_y) * passed_s;
  const auto moved = [](double from, double by, double limit) {
    return std::clamp(from + by, -limit, limit);
  };
  TablePlace& table = base_.table;
  switch (stick_) {
    case Stick::kArm:
      base_.lao_rad = moved(base_.lao_rad, x_rad, kLaoLimitRad);
      base_.cra_rad = moved(base_.cra_rad, y_rad, kCraLimitRad);
      break;
    case Stick::kTable:
      table.left_mm = moved(table.left_mm, kTableMmPerRad * x_rad, kTableLeftLimitMm);
      table.head_mm = moved(table.head_mm, kTableMmPerRad * y_rad, kTableHeadLimitMm);
      break;
    case Stick::kHeight:
      table.height_mm = moved(table.height_mm, kTableHeightMmPerRad * y_rad, kTableHeightLimitMm);
      break;
  }
}

std::optional<MarkPassage> HandTracker::PassMark(const device::Sample& sample) {
  // If the switch closed before the epoch began, the travel at that moment is unknown.
  if (!last_ || sample.epoch_start != device::EpochStart::kNone) return std::nullopt;
  if ((sample.flags & protocol::kFlagReference) == 0) return std::nullopt;
  const std::uint8_t risen = static_cast<std::uint8_t>(sample.flags & ~last_->flags);
  const bool closed = (risen & (protocol::kFlagReference | protocol::kFlagAtReference)) != 0 ||
                      sample.reference_counts != last_->reference_counts;
  if (!closed) return std::nullopt;

  ++counters_.marks_passed;
  const std::int64_t since = sample.axial_counts - sample.reference_counts;
  const double travel_mm = TravelMm(travel_axial_ - since);
  MarkPassage passage;
  passage.first = !mark_mm_;
  if (mark_mm_) passage.lost_mm = *mark_mm_ - travel_mm;
  passage.refused = std::abs(passage.lost_mm) > kLongestLossMm;
  if (passage.first || passage.refused) {
    mark_mm_ = travel_mm;
  } else if (std::abs(passage.lost_mm) < kMarkToleranceMm) {
    passage.lost_mm = 0.0;
  } else {
    travel_base_mm_ += passage.lost_mm;
    to_heal_mm_ += passage.lost_mm;
  }
  return passage;
}

void HandTracker::Heal(const device::Sample& sample) {
  if (to_heal_mm_ == 0.0 || !last_ || sample.epoch_start != device::EpochStart::kNone) return;
  const double most_mm = kHealMmPerS * PassedS(sample);
  const double step_mm = std::clamp(to_heal_mm_, -most_mm, most_mm);
  to_heal_mm_ -= step_mm;
  base_.insertion_mm += step_mm;
  healed_mm_ += step_mm;
  counters_.healed_um = std::llround(1000.0 * healed_mm_);
}

// Time since the previous sample, s; a pause longer than kLongestHoldUs counts as kLongestHoldUs.
double HandTracker::PassedS(const device::Sample& sample) const {
  return 1e-6 * static_cast<double>(std::clamp<std::int64_t>(
                    sample.device_time_us - last_->device_time_us, 0, kLongestHoldUs));
}

double HandTracker::TravelMm(std::int64_t axial) const {
  return travel_base_mm_ +
         calibration::Apply(calibration_.motion, axial, travel_transverse_).insertion_mm;
}

// Nominal gains follow the sensor's resolution; the pose so far is kept.
void HandTracker::UseResolution(int cpi) {
  if (cpi == calibration_.motion.cpi) return;
  base_ = CurrentPose();
  travel_base_mm_ = TravelMm(travel_axial_);
  travel_axial_ = 0;
  travel_transverse_ = 0;
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
