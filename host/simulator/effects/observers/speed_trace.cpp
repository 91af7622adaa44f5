#include "host/simulator/effects/observers/speed_trace.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace torquer::effects {

namespace {
constexpr double kRestingMmS = 0.5;
constexpr double kMovementMmS = 2;
}  // namespace

void SpeedTrace::Add(double time_s, double position_mm) {
  if (!begun_) {
    begun_ = true;
    sample_mm_ = position_mm;
    next_sample_s_ = time_s + kStepS;
  } else {
    while (time_s >= next_sample_s_) {
      const double span = time_s - last_time_s_;
      const double fraction = span > 0 ? (next_sample_s_ - last_time_s_) / span : 1;
      AddSample(last_mm_ + fraction * (position_mm - last_mm_));
      next_sample_s_ += kStepS;
    }
  }
  last_time_s_ = time_s;
  last_mm_ = position_mm;
}

void SpeedTrace::AddSample(double position_mm) {
  std::rotate(raw_.begin(), raw_.begin() + 1, raw_.end());
  raw_[4] = (position_mm - sample_mm_) / kStepS;
  sample_mm_ = position_mm;
  ++samples_;
  std::rotate(smooth_.begin(), smooth_.begin() + 1, smooth_.end());
  smooth_[2] = (raw_[0] + 4 * raw_[1] + 6 * raw_[2] + 4 * raw_[3] + raw_[4]) / 16;

  const double jerk = (smooth_[2] - 2 * smooth_[1] + smooth_[0]) / (kStepS * kStepS);
  jerk_integral_ += jerk * jerk * kStepS;
  const double speed = std::abs(smooth_[2]);
  peak_ = std::max(peak_, speed);
  if (speed > kRestingMmS) {
    moving_mm_ += speed * kStepS;
    moving_s_ += kStepS;
  }
  if (rising_allowed_ && speed > kMovementMmS) {
    ++submovements_;
    rising_allowed_ = false;
    current_peak_ = speed;
  }
  current_peak_ = std::max(current_peak_, speed);
  if (!rising_allowed_ && speed < current_peak_ / 2) {
    // From now on the next movement may begin, once the speed grows again.
    rising_allowed_ = speed < kMovementMmS || speed > std::abs(smooth_[1]);
  }
}

double SpeedTrace::log_dimensionless_jerk() const {
  if (peak_ <= kRestingMmS) return std::numeric_limits<double>::quiet_NaN();
  const double duration_s = static_cast<double>(samples_) * kStepS;
  return -std::log(std::pow(duration_s, 3) / (peak_ * peak_) * jerk_integral_);
}

}  // namespace torquer::effects
