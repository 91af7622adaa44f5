// Hand tracker: converts samples to the commanded position of the instrument, as absolute
// insertion, rotation, C-arm angles and table position.
//
// Motion between two consecutive samples is applied if both are trusted and have the clutch
// released. A lift, a poor surface and a sensor fault put a sample in doubt. Motion that is not
// applied is dropped: the instrument stays and continues from there. The applied counts are summed
// as integers and converted at once, so that no rounding errors accumulate.
//
// A device with an end switch reveals lost motion. The hand's true travel, including clutched
// motion, is the same at each closing of the switch. The counted travel differs if motion was
// dropped or not measured since the previous closing. The tracker then adds the difference to the
// insertion at kHealMmPerS, only while motion is applied. So the instrument never jumps. No I/O, no
// clock.
#pragma once

#include <cstdint>
#include <optional>

#include "calibration/motion_model.h"
#include "host/device/report_decoder.h"

namespace torquer::daemon {

/// Displacement of the table with the patient since the start, as in table_command_t.
struct TablePlace {
  double left_mm = 0.0;    ///< -kTableLeftLimitMm .. kTableLeftLimitMm
  double head_mm = 0.0;    ///< -kTableHeadLimitMm .. kTableHeadLimitMm
  double height_mm = 0.0;  ///< -kTableHeightLimitMm .. kTableHeightLimitMm
  bool operator==(const TablePlace&) const = default;
};

/// Absolute position of an instrument, of the C-arm and of the table.
struct Pose {
  double insertion_mm = 0.0;  ///< past the entry point since the start, positive distally
  double rotation_rad = 0.0;  ///< positive right-handed about the distal tangent
  double lao_rad = 0.0;       ///< -kLaoLimitRad .. kLaoLimitRad
  double cra_rad = 0.0;       ///< -kCraLimitRad .. kCraLimitRad
  TablePlace table{};
};

/// Travel of the C-arm: 90 degrees to each side, 45 degrees to head and feet.
inline constexpr double kLaoLimitRad = 1.5707963267948966;
inline constexpr double kCraLimitRad = 0.7853981633974483;
/// Travel of the table, which the simulator enforces too.
inline constexpr double kTableLeftLimitMm = 150.0;
inline constexpr double kTableHeadLimitMm = 500.0;
inline constexpr double kTableHeightLimitMm = 150.0;

/// One closing of the end switch (the mark).
struct MarkPassage {
  bool first = false;  ///< first closing: the place of the switch is known from now on, no loss yet
  bool refused = false;  ///< loss longer than kLongestLossMm: not corrected
  double lost_mm =
      0.0;  ///< motion missing from the count since the previous passage, positive distally
};

/// The hand's command: pose, pedals and flags.
struct HandState {
  Pose pose;
  bool xray = false;
  bool contrast = false;
  std::int32_t flags = 0;          ///< protocol::InstrumentFlag bits
  std::uint16_t joystick_x = 512;  ///< as in the report; at rest without a device
  std::uint16_t joystick_y = 512;  ///< the same
  int start = 0;  ///< incremented by each Home(), which changes the zero of the positions
  std::optional<MarkPassage> mark;  ///< with the first sample after the switch has closed
};

/// Sums over all samples, counts.
struct TrackerCounters {
  std::int64_t axial_applied = 0;
  std::int64_t transverse_applied = 0;
  std::int64_t axial_held = 0;  ///< counted while the clutch was held or motion was in doubt
  std::int64_t transverse_held = 0;
  std::int64_t marks_passed = 0;
  std::int64_t healed_um = 0;  ///< motion made up for at the marks; pushing is positive
};

class HandTracker {
 public:
  /// With a calibration, samples at another sensor resolution than its own are a sensor fault.
  /// Without one (nullopt) nominal gains hold for any resolution, and every state has the flag
  /// kCommandUncalibrated.
  HandTracker(const std::optional<calibration::Calibration>& calibration, const Pose& start);

  /// Takes the next sample, in order.
  HandState Step(const device::Sample& sample);

  /// State to publish without a device: the last pose, pedals up.
  HandState Hold() const;

  /// Makes the present position of the instrument its start. Sets C-arm upright and table back.
  void Home();

  /// Call when another device is connected: the position of its mark is unknown.
  void ForgetMark() { mark_mm_.reset(); }

  const TrackerCounters& counters() const { return counters_; }

  /// Highest speed at which lost motion is corrected.
  static constexpr double kHealMmPerS = 20.0;
  /// Motion of the table for a deflection that would turn the C-arm by one radian.
  static constexpr double kTableMmPerRad = 160.0;
  static constexpr double kTableHeightMmPerRad = 80.0;
  /// Repeatability of the switch, mm: a smaller difference does not count as lost motion.
  static constexpr double kMarkToleranceMm = 0.3;
  /// Whole travel of the cylinder, mm: a greater difference is refused, not corrected.
  static constexpr double kLongestLossMm = 150.0;

 private:
  std::int32_t Doubts(const device::Sample& sample);
  void Move(const device::Sample& sample, bool held);
  void UseStick(const device::Sample& sample);
  void ChooseStick(const device::Sample& sample);
  std::optional<MarkPassage> PassMark(const device::Sample& sample);
  void Heal(const device::Sample& sample);
  double PassedS(const device::Sample& sample) const;
  double TravelMm(std::int64_t axial) const;
  void UseResolution(int cpi);
  Pose CurrentPose() const;

  enum class Stick { kArm, kTable, kHeight };

  bool calibrated_;
  calibration::Calibration calibration_;
  int start_ = 0;
  Pose base_;  // pose at which the applied counts below were 0
  std::int64_t axial_ = 0;
  std::int64_t transverse_ = 0;
  std::optional<device::Sample> last_;
  bool last_held_ = false;
  bool poor_surface_ = false;
  Stick stick_ = Stick::kArm;
  // The hand's known travel: the counts converted to mm plus the corrections from the marks.
  double travel_base_mm_ = 0.0;
  std::int64_t travel_axial_ = 0;
  std::int64_t travel_transverse_ = 0;
  std::optional<double> mark_mm_;  // travel at which the switch closes
  double to_heal_mm_ = 0.0;        // lost motion still to be corrected
  double healed_mm_ = 0.0;
  TrackerCounters counters_;
};

}  // namespace torquer::daemon
