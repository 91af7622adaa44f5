// A device's calibration from measured strokes and turns, with its uncertainty.
//
// Sensor counts are nearly exact; the motion of the hand is uncertain. Pushes give the counts of a
// millimeter, turns those of a radian. Each is a weighted line through the origin in the plane of
// counts. The scatter of its strokes gives its error, independent of assumptions about ruler and
// hand. An error that all strokes share (the length between the end stops, a habit of the hand)
// causes no scatter; it is declared, and added. Formulas: README.md beside this file. No I/O.
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
  double reference_error = 1.0;  ///< of this one stroke, mm or rad, > 0; weighs it against others
};

/// Errors common to all strokes, each as a standard deviation, >= 0.
struct CommonErrors {
  double push_mm = 0.0;        ///< of the length that was pushed: the stops' distance, the ruler
  double push_turn_rad = 0.0;  ///< the hand's habit of turning in each push
  double turn_rad = 0.0;       ///< of the angle that was turned
  double turn_push_mm = 0.0;   ///< the hand's habit of pushing in each turn
  /// Largest change of the gain by the height of the cylinder, as a share; a bound, not a standard
  /// deviation. Raised pushes replace it by a measured one.
  double height_gain = 0.0;
};

/// Largest share by which the counts of a motion change for each millimeter of height: PMW3360 data
/// sheet 1.50, figure 12 (0.028 to 0.13 by surface), and feature spacing in pictures (0.15).
inline constexpr double kLargestHeightGain_per_mm = 0.15;

/// Half the width of the interval that holds 95 % of Student's t distribution with
/// `degrees_of_freedom` (> 0, need not be whole; infinity gives the normal distribution's 1.96).
double StudentHalfWidth95(double degrees_of_freedom);

/// A value, and how sure it is.
struct Estimate {
  double value = 0.0;
  double standard_error = 0.0;
  double degrees_of_freedom = 1.0;  ///< by Welch and Satterthwaite; infinite for declared errors
  /// Further error of unknown distribution, >= 0: the height of the cylinder while it is used.
  double bound = 0.0;
  /// The truth is within value -+ this in at least 95 % of runs, wherever in its bound it is.
  double HalfWidth95() const;
};

struct MotionFit {
  MotionModel model;  ///< with its standard errors

  /// The same in terms that a person can picture: MotionParameters, in its units.
  Estimate gain_mm_per_count, misalignment_rad, cylinder_radius_mm, skew_rad;

  /// Difference between the model's motion and a true motion. The values are 0; the standard errors
  /// are the figures of interest to a user.
  Estimate push_error_mm;   ///< in insertion, over a push of kFigureStrokeMm
  Estimate push_turns_rad;  ///< in rotation, over the same push
  Estimate turn_error_rad;  ///< in rotation, over one turn
  Estimate turn_pushes_mm;  ///< in insertion, over one turn

  /// Shares of the variance of push_error_mm and turn_error_rad that are declared, 0 .. 1: what
  /// more strokes would not remove.
  double push_declared_share = 0.0, turn_declared_share = 0.0;

  /// Change of the counts from a push at rest to a raised one, as a share; 0 without raised pushes.
  Estimate height_gain;
  bool height_measured = false;  ///< by raised pushes; else height_gain is the declared bound

  /// Reference less model, one a stroke, in the order given.
  std::vector<HandMotion> residuals;
  /// Scatter of one stroke, standard deviations.
  HandMotion push_scatter, turn_scatter;
};

/// Length of the push that push_error_mm speaks of: the device's travel.
inline constexpr double kFigureStrokeMm = 150.0;

/// Throws UserError naming stroke, value and remedy when a number is not finite or not as above,
/// when there are fewer than two pushes or two turns, a single raised push, or when pushes and
/// turns move the counts the same way.
MotionFit FitMotion(std::span<const Stroke> strokes, const CommonErrors& common, int cpi);

/// A joystick axis from readings (0 .. 1023) with the stick at rest, released several times, and
/// from readings while it was moved to both ends. The dead zone covers all rest readings and four
/// standard deviations. Throws UserError when there are none or the stick did not reach far enough.
JoystickAxis FitJoystickAxis(std::span<const double> at_rest, std::span<const double> moved,
                             double full_rate_rad_per_s);

/// Counts from the dead zone's edge to an end, below which a stick was not moved there.
inline constexpr double kLeastJoystickTravel = 100.0;

}  // namespace torquer::calibration
