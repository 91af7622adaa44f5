// A device's calibration from reference motions, with its uncertainty.
//
// The counts of a stroke are as good as exact; what is uncertain is the reference: a ruler is read
// to half a millimeter, and a hand that pushes also turns by a degree without knowing. So each row
// of the motion model is a weighted linear regression of the reference on the counts, with the
// declared errors of the references as known standard deviations (Bevington and Robinson, "Data
// Reduction and Error Analysis", 3rd ed., ch. 7). No I/O.
#pragma once

#include <span>
#include <vector>

#include "calibration/motion_model.h"

namespace torquer::calibration {

/// One stroke or turn: what the sensor counted, what the hand did according to the reference, and
/// how far off (one standard deviation) that may be.
struct ReferenceMotion {
  double axial_counts = 0.0;
  double transverse_counts = 0.0;
  double insertion_mm = 0.0;
  double rotation_rad = 0.0;
  double insertion_error_mm = 0.5;     ///< > 0
  double rotation_error_rad = 0.0175;  ///< > 0
};

/// Standard errors times this are half widths of 95 % intervals (the errors are declared, not
/// estimated from the scatter, so the normal distribution holds for any number of strokes).
inline constexpr double kInterval95 = 1.959963984540054;

struct MotionFit {
  MotionModel model;                 ///< with its standard errors
  MotionParameters parameters;       ///< the same in terms that a person can picture
  MotionParameters parameter_error;  ///< their standard errors
  /// Reference less model, one a motion, in the order given.
  std::vector<HandMotion> residuals;
  /// Sum of squared residuals over squared declared errors; about degrees_of_freedom when the
  /// declared errors are honest.
  double chi_squared = 0.0;
  int degrees_of_freedom = 0;  ///< 2 per motion, less the 4 gains
};

/// Throws UserError naming the motion, the value and the remedy when one is not finite, when a
/// declared error is not positive, or when pushing and turning cannot be told apart.
MotionFit FitMotion(std::span<const ReferenceMotion> motions, int cpi);

/// A joystick axis from readings (0 .. 1023) with the stick at rest, released several times, and
/// from readings while it was moved to both ends. The dead zone covers all rest readings and four
/// standard deviations. Throws UserError when there are none or the stick did not reach far enough.
JoystickAxis FitJoystickAxis(std::span<const double> at_rest, std::span<const double> moved,
                             double full_rate_rad_per_s);

}  // namespace torquer::calibration
