// Vital signs: the curves and figures of the patient monitor.
#pragma once

#include <array>
#include <cstdint>
#include <limits>

namespace torquer::effects {

/// Reasons for an alarm of the patient monitor, as bits.
enum PatientAlarm : int {
  kRateLow = 1 << 0,
  kRateHigh = 1 << 1,
  kSystolicLow = 1 << 2,
  kSystolicHigh = 1 << 3,
  kPressureDamped = 1 << 4,  ///< the tip closes the lumen
};

/// Curves since a second ago, and figures of the last whole beat. NaN: not known.
struct VitalSigns {
  static constexpr double kSampleS = 4e-3;  ///< interval between samples
  static constexpr int kKept = 250;         ///< samples that are kept
  static constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  struct Sample {
    float ecg = 0;  ///< the R wave has the height 1
    float pressure_mmHg = 0;
  };
  struct Limits {
    double rate_low_per_min = 50;
    double rate_high_per_min = 120;
    double systolic_low_mmHg = 90;
    double systolic_high_mmHg = 160;
  };

  /// Number of samples since the start; sample n is at the time n kSampleS.
  std::int64_t samples = 0;
  std::array<Sample, kKept> kept{};  ///< sample n at n modulo kKept
  double rate_per_min = kUnknown;    ///< of the heart
  double beat_s = kUnknown;          ///< time of the newest R wave
  // Figures of the last whole beat; without a heart, of the last whole second.
  double systolic_mmHg = kUnknown;
  double diastolic_mmHg = kUnknown;
  double mean_mmHg = kUnknown;
  bool wedged = false;  ///< the tip closes the lumen
  int alarms = 0;       ///< bits: PatientAlarm
  Limits limits;

  /// Number of the oldest kept sample.
  std::int64_t first() const { return samples > kKept ? samples - kKept : 0; }
  const Sample& at(std::int64_t number) const {
    return kept[static_cast<std::size_t>(number % kKept)];
  }
};

}  // namespace torquer::effects
