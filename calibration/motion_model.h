// Motion model: converts the bench device's raw counts to mm, rad and rad/s.
//
// The sensor looks at a cylinder that is pushed along its axis and turned about it. A surface
// motion of s mm distally and c = R * angle mm around moves the counts along two directions:
//
//        transverse ^   / pushing            [axial     ]   1  [cos -sin] [s]
//                   |  / (angle = misalign-  [transverse] = -  [sin  cos] [c]    g = mm a count
//                   | /   ment)                             g
//                   +------> axial
//
// The model is the inverse map, a full 2x2 matrix. It covers unequal gains and axes of the sensor
// that are not at right angles. No I/O, no clock.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

namespace torquer::calibration {

/// Radius of the device's cylinder in the drawing, mm, and the resolution of its sensor at the
/// start.
inline constexpr double kNominalCylinderRadiusMm = 5.0;
inline constexpr int kNominalCpi = 1200;
inline constexpr double kMmPerInch = 25.4;

using Matrix2 = std::array<std::array<double, 2>, 2>;

/// A motion of the hand: insertion in mm, positive distally; rotation in rad, positive
/// right-handed about the distal tangent.
struct HandMotion {
  double insertion_mm = 0.0;
  double rotation_rad = 0.0;
};

/// Counts to hand motion, linear.
struct MotionModel {
  int cpi = kNominalCpi;  ///< the sensor resolution that the gains hold for, counts an inch
  /// Rows: insertion (mm), rotation (rad). Columns: one axial count, one transverse count.
  Matrix2 per_count{};
  /// Standard errors of per_count, same shape and units; all 0 when nominal.
  Matrix2 standard_error{};
};

/// Motion that corresponds to `axial_counts` and `transverse_counts`. Exact to double rounding for
/// any counts below 2^53.
HandMotion Apply(const MotionModel& model, std::int64_t axial_counts,
                 std::int64_t transverse_counts);

/// Geometric parameters of a MotionModel (assuming one gain for both axes of the sensor).
struct MotionParameters {
  double gain_mm_per_count = 0.0;   ///< surface motion a count; > 0
  double misalignment_rad = 0.0;    ///< direction of pushing, from the axial count axis
  double cylinder_radius_mm = 0.0;  ///< > 0
  double skew_rad = 0.0;            ///< angle from pushing to turning, minus 90 degrees
};

/// Exact inverse of each other; Parameters() needs a model with a nonzero first row.
MotionModel ModelOf(const MotionParameters& parameters, int cpi);
MotionParameters ParametersOf(const MotionModel& model);

/// One joystick axis: counts (0 .. 1023) to a turning rate of the C-arm. The rate is 0 in the dead
/// zone, grows linearly outside it and is full at the extremes and beyond.
struct JoystickAxis {
  double center = 512.0;              ///< counts at rest
  double minimum = 0.0;               ///< counts at the negative extreme, < center - dead_zone
  double maximum = 1023.0;            ///< counts at the positive extreme, > center + dead_zone
  double dead_zone = 25.0;            ///< counts each side of the center, >= 0
  double full_rate_rad_per_s = 0.35;  ///< at the extremes; > 0, about 20 degrees a second
};

/// Turning rate in rad/s for a reading of `counts`.
double Rate(const JoystickAxis& axis, double counts);

/// Calibration: all values that convert the reports of one device into motion.
struct Calibration {
  std::string device;  ///< serial number of the one device that it holds for
  std::string note;    ///< origin of the calibration, for people; may be empty
  /// Product id of the sensor during the calibration; empty if unknown.
  std::optional<int> sensor_product_id;
  MotionModel motion;
  JoystickAxis lao;  ///< joystick x: positive LAO
  JoystickAxis cra;  ///< joystick y: positive CRA
};

/// Nominal calibration: correct for an exactly built device with a sensor set to `cpi`.
Calibration NominalCalibration(const std::string& device, int cpi);

}  // namespace torquer::calibration
