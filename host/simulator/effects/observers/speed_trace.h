// Speed trace: measures of a hand's smoothness. Speed from positions, its peaks and its jerk.
#pragma once

#include <array>
#include <limits>

namespace torquer::effects {

/// Resamples incoming positions evenly and smooths the speed over some 0.1 s, because a sensor's
/// counts have steps. Accumulates the smoothness measures. No heap.
class SpeedTrace {
 public:
  /// Position in mm at a time in s; times must not descend.
  void Add(double time_s, double position_mm);

  double peak_mm_s() const { return peak_; }
  /// Mean of |speed| over the time with |speed| above the resting speed of 0.5 mm/s; NaN without
  /// motion.
  double mean_moving_mm_s() const {
    return moving_s_ > 0 ? moving_mm_ / moving_s_ : std::numeric_limits<double>::quiet_NaN();
  }
  /// Number of separate movements: |speed| rises above 2 mm/s after it fell below half of the
  /// previous peak.
  int submovements() const { return submovements_; }
  /// Log dimensionless jerk of the speed v over the whole time T (Balasubramanian et al. 2015):
  ///   -ln( T^3 / v_peak^2  integral of (d2v/dt2)^2 dt );  a single minimum-jerk movement: -5.32.
  /// Values nearer to zero are smoother. NaN before any motion.
  double log_dimensionless_jerk() const;

 private:
  void AddSample(double position_mm);

  static constexpr double kStepS = 0.02;
  bool begun_ = false;
  double last_time_s_ = 0;
  double last_mm_ = 0;
  double next_sample_s_ = 0;
  double sample_mm_ = 0;
  long samples_ = 0;
  std::array<double, 5> raw_{};     // speeds, the newest last
  std::array<double, 3> smooth_{};  // smoothed speeds, the newest last
  double peak_ = 0;
  double jerk_integral_ = 0;
  double moving_mm_ = 0;
  double moving_s_ = 0;
  int submovements_ = 0;
  bool rising_allowed_ = true;
  double current_peak_ = 0;
};

}  // namespace torquer::effects
