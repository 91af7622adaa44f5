// Motion script: position of the hand over time, read from a CSV file.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace torquer::emulator {

/// The operator's hand, joystick and buttons at one time.
struct HandState {
  double insertion_mm = 0;  ///< absolute, positive distally
  double rotation_rad = 0;  ///< absolute, positive right-handed
  double joystick_x = 0;    ///< -1 .. 1
  double joystick_y = 0;
  std::uint8_t buttons = 0;  ///< protocol::Button bits
  bool raises = false;       ///< lifts the cylinder off the floor of its bore, by its whole play
  double catheter_insertion_mm = 0;  ///< of the second cylinder, in a box with two sensors
  double catheter_rotation_rad = 0;
};

class MotionScript {
 public:
  /// A hand that never moves.
  MotionScript() = default;

  /// Reads `time_s,insertion_mm,rotation_rad,joystick_x,joystick_y,buttons`, and, for two sensors,
  /// also `catheter_insertion_mm,catheter_rotation_rad`. Each row has one time, and times rise.
  /// `buttons` is `none`, empty, or names among xray, contrast, clutch, stick joined by `+`. Throws
  /// UserError naming file, line, the value and the remedy.
  static MotionScript FromFile(const std::string& path);

  /// Linear between rows; before the first and after the last it stands still. Buttons change at
  /// the rows.
  HandState At(double time_s) const;

  double duration_s() const { return rows_.empty() ? 0 : rows_.back().time_s; }

 private:
  struct Row {
    double time_s = 0;
    HandState hand;
  };
  std::vector<Row> rows_;
};

}  // namespace torquer::emulator
