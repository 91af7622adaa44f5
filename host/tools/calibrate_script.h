// Calibration scripts: actions of the operator, and optionally of the device, for
// torquer-calibrate.
//
// A script has one statement per line; blank lines and text after # are skipped. The first line is
// exactly "torquer-calibrate script 1". Statements of the operator:
//
//   mark                             press Enter
//   undo                             forget the last stroke
//   skip STEP                        skip the step rest, lift or joystick
//   quit                             give up, as Ctrl-C does
//
// With --source, `mark` waits until the hand has moved by 100 counts since the step's last mark.
// The hand must then rest for 0.3 s. `skip` waits for its step. Without --source no step waits, and
// the script moves a simulated device with readings every millisecond. Its first statement names
// this device:
//
//   device SERIAL CPI
//   rest SECONDS
//   move AXIAL TRANSVERSE SECONDS    by so many counts, evenly over that time
//   lift SECONDS                     the sensor sees no surface
//   fault SECONDS                    the sensor does not answer
//   joystick X Y SECONDS             holds the stick there, 0 .. 1023
//   reset                            the device restarts
#pragma once

#include <string>
#include <vector>

namespace torquer::tools {

struct Statement {
  enum class Kind {
    kMark,
    kUndo,
    kSkip,
    kQuit,
    kDevice,
    kRest,
    kMove,
    kLift,
    kFault,
    kJoystick,
    kReset
  };
  Kind kind = Kind::kMark;
  int line = 0;
  std::string word;             ///< kDevice: serial number; kSkip: the step
  std::vector<double> numbers;  ///< as in the table above
};

struct Script {
  std::string path;
  std::vector<Statement> statements;
};

/// Throws UserError with the file, the line, the error and the expected input.
Script ParseScript(const std::string& text, const std::string& path);
Script ReadScript(const std::string& path);

}  // namespace torquer::tools
