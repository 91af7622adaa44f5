// Fits a device's calibration, with its uncertainty, to measured strokes and turns.
//
// Sensor counts are nearly exact; the motion of the hand is uncertain. Pushes give the counts per
// mm, turns the counts per rad. Each is a weighted line through the origin in the plane of counts.
// The scatter of the strokes gives the error of the line, without assumptions about ruler and hand.
// An error common to all strokes causes no scatter. Examples are a wrong distance of the end stops
// and a habit of the hand. Such errors are declared and added. Formulas: README.md beside this
// file. No I/O.
#pragma once

#include <span>
#include <vector>

#include "calibration/motion_model.h"

namespace torquer::calibration {

enum class MotionKind {
  kPush,
  kTurn,
  kRaisedPush  ///< a push with the cylinder raised to the top of its play
};

/// One stroke or some whole turns, from rest to rest.
struct Stroke {
  MotionKind kind = MotionKind::kPush;
  double axial_counts = 0.0;
  double transverse_counts = 0.0;
  double reference = 0.0;        ///< motion requested from the hand: mm or rad, signed, not 0
  double reference_error = 1.0;  ///< of this one stroke, mm or rad, > 0; gives its weight
};

/// Errors common to all strokes, each as a standard deviation, >= 0.
struct CommonErrors {
  double push_mm = 0.0;        ///< of the pushed length: distance of the stops, ruler
  double push_turn_rad = 0.0;  ///< the hand's habit of turning in each push
  double turn_rad = 0.0;       ///< of the angle that was turned
  double turn_push_mm = 0.0;   ///< the hand's habit of pushing in each turn
  /// Largest relative change of the gain by the height of the cylinder. It is a bound, not a
  /// standard deviation. Raised pushes replace it by a measured change.
  double height_gain = 0.0;
};

/// Largest relative change of the counts of a motion per mm of height. PMW3360 data sheet 1.50,
/// figure 12, shows 0.028 to 0.13, depending on the surface. Feature spacing in pictures gives
/// 0.15.
inline constexpr double kLargestHeightGain_per_mm = 0.15;

/// Half the width of the interval that contains 95 % of Student's t distribution.
/// `degrees_of_freedom` is above 0 and may be a fraction; infinity gives 1.96, as for a normal
/// distribution.
double StudentHalfWidth95(double degrees_of_freedom);

/// A value with its uncertainty.
struct Estimate {
  double value = 0.0;
  double standard_error = 0.0;
  double degrees_of_freedom = 1.0;  ///< by Welch and Satterthwaite; infinite for declared errors
  /// Further error of unknown distribution, >= 0: the height of the cylinder while it is used.
  double bound = 0.0;
  /// In at least 95 % of runs the true value is within value +- this, for any height within the
  /// bound.
  double HalfWidth95() const;
};

struct MotionFit {
  MotionModel model;  ///< with its standard errors

  /// The same as geometric parameters: MotionParameters, in its units.
  Estimate gain_mm_per_count, misalignment_rad, cylinder_radius_mm, skew_rad;

  /// Difference between the model's motion and a true motion. The values are 0; the standard errors
  /// are the figures of interest to a user.
  Estimate push_error_mm;   ///< in insertion, over a push of kFigureStrokeMm
  Estimate push_turns_rad;  ///< in rotation, over the same push
  Estimate turn_error_rad;  ///< in rotation, over one turn
  Estimate turn_pushes_mm;  ///< in insertion, over one turn

  /// Fractions of the variance of push_error_mm and turn_error_rad that are declared, 0 .. 1. More
  /// strokes do not reduce them.
  double push_declared_share = 0.0, turn_declared_share = 0.0;

  /// Relative change of the counts from a push at rest to a raised push; 0 without raised pushes.
  Estimate height_gain;
  bool height_measured = false;  ///< false: height_gain is the declared bound

  /// Reference minus model, for each stroke in the given order.
  std::vector<HandMotion> residuals;
  /// Scatter of one stroke, standard deviations.
  HandMotion push_scatter, turn_scatter;
};

/// Length of the push that push_error_mm refers to: the device's travel.
inline constexpr double kFigureStrokeMm = 150.0;

/// Throws UserError for a number that is not finite or not as above. Throws for fewer than two
/// pushes or two turns, and for a single raised push. Also throws if pushes and turns change the
/// counts in the same direction. The message names the stroke, value and remedy.
MotionFit FitMotion(std::span<const Stroke> strokes, const CommonErrors& common, int cpi);

/// A joystick axis from readings (0 .. 1023) with the stick at rest, released several times, and
/// from readings while it was moved to both ends. The dead zone covers all rest readings and four
/// standard deviations. Throws UserError without readings, or if the stick was not moved far
/// enough.
JoystickAxis FitJoystickAxis(std::span<const double> at_rest, std::span<const double> moved,
                             double full_rate_rad_per_s);

/// Smallest counts from the edge of the dead zone to an end. A stick with less was not moved to
/// that end.
inline constexpr double kLeastJoystickTravel = 100.0;

}  // namespace torquer::calibration
