// Check of strokes: finds the usable ones, and gives the reason why each other stroke is refused.
// No I/O.
//
// Each stroke is first checked alone: sensor not lifted, long enough, a push. Then it is compared
// with the other strokes of its kind. The distance of an outlier from their median exceeds four
// times its declared error. It also exceeds four times the error that their scatter suggests. So an
// unsteady hand is measured and not refused.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibration/fit.h"

namespace torquer::calibration {

/// Requested motion of a stroke, and known properties of its device.
struct StrokeExpectation {
  double push_mm = 150.0;            ///< > 0
  double turn_rad = 0.0;             ///< > 0, whole turns
  double push_error_mm = 0.5;        ///< of one stroke, standard deviation, > 0
  double push_turn_error_rad = 0.0;  ///< unintended turn of the hand during a push, > 0
  double turn_error_rad = 0.0;       ///< > 0
  double turn_push_error_mm = 0.5;   ///< unintended push of the hand during a turn, > 0
  double gain_mm_per_count = 0.0;    ///< by the sensor's resolution, > 0
  double gain_factor = 1.3;  ///< the true gain is within this factor of gain_mm_per_count, > 1
  double cylinder_radius_mm = kNominalCylinderRadiusMm;
  double radius_factor = 1.3;  ///< likewise
};

/// A stroke and the way back to where it began.
struct RecordedStroke {
  Stroke stroke;
  double back_axial_counts = 0.0;  ///< of the way back; ideally minus the counts of the stroke
  double back_transverse_counts = 0.0;
  bool lifted = false;       ///< lift flag or poor surface, there or back
  bool faulty = false;       ///< sensor fault
  bool interrupted = false;  ///< the device was reset or away, or its counts jumped
};

/// Empty for a good stroke. Otherwise the reason of the refusal, as a sentence without its full
/// stop.
using Rejection = std::optional<std::string>;

/// Judges all strokes of a run together, pushes among pushes and turns among turns.
std::vector<Rejection> JudgeStrokes(std::span<const RecordedStroke> strokes,
                                    const StrokeExpectation& expected);

}  // namespace torquer::calibration
