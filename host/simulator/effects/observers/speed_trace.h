// How smoothly a hand moves: speed from positions, its peaks and its jerk.
#pragma once

#include <array>

namespace torquer::effects {

/// Takes positions as they come, resamples them evenly, smooths the speed over some 0.1 s (a
/// sensor's counts have steps) and sums up what smoothness is judged by. No heap.
class SpeedTrace {
 public:
  /// Position in mm at a time in s; times must not descend.
  void Add(double time_s, double position_mm);

  double peak_mm_s() const { return peak_; }
  /// Mean of |speed| over the time in which it was above the resting speed of 0.5 mm/s; 0 if never.
  double mean_moving_mm_s() const { return moving_s_ > 0 ? moving_mm_ / moving_s_ : 0; }
  /// Separate movements: times that |speed| rose above 2 mm/s after it had fallen below half of the
  /// peak before.
  int submovements() const { return submovements_; }
  /// Log dimensionless jerk of the speed v over the whole time T (Balasubramanian et al. 2015):
  ///   -ln( T^3 / v_peak^2  integral of (d2v/dt2)^2 dt );  a single minimum-jerk movement: -5.32.
  /// The nearer to zero, the smoother. 0 before anything moved.
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
  std::array<double, 3> smooth_{};  // the same, smoothed
  double peak_ = 0;
  double jerk_integral_ = 0;
  double moving_mm_ = 0;
  double moving_s_ = 0;
  int submovements_ = 0;
  bool rising_allowed_ = true;
  double current_peak_ = 0;
};

}  // namespace torquer::effects
