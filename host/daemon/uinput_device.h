// Virtual input device for software that does not support Torquer. The kernel's uinput presents the
// bench device as an input device of this machine.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "host/daemon/hand_tracker.h"

namespace torquer::daemon {

/// An event of the kernel's input layer (linux/input-event-codes.h).
struct BoxEvent {
  unsigned type = 0;
  unsigned code = 0;
  int value = 0;

  bool operator==(const BoxEvent&) const = default;
};

/// Length and angle that one unit of the relative axes stands for.
inline constexpr double kUinputMm = 0.01;
inline constexpr double kUinputRad = 0.001;

/// Converter from hand states to events: REL_Z insertion and REL_RZ rotation of the instrument,
/// ABS_X and ABS_Y the stick (0 .. 1023), BTN_TRIGGER X-ray, BTN_THUMB contrast, BTN_THUMB2 clutch.
/// The sums of the relative axes are the motion since the first state, rounded once. No I/O.
class BoxEvents {
 public:
  /// Events from the previous state to this one; empty without a change. The first position, and
  /// the first after a new start, produce no motion events.
  std::vector<BoxEvent> Of(const HandState& hand);

 private:
  struct State {
    int start = 0;
    std::int64_t insertion = 0;  // in units of the axes
    std::int64_t rotation = 0;
    int stick_x = 0;
    int stick_y = 0;
    bool xray = false;
    bool contrast = false;
    bool clutch = false;
  };
  std::optional<State> last_;
};

class UinputDevice {
 public:
  /// Creates the device with the name `name`; it exists until destruction. Throws UserError if the
  /// user may not create it, or the kernel has no uinput.
  explicit UinputDevice(const std::string& name);
  ~UinputDevice();
  UinputDevice(const UinputDevice&) = delete;
  UinputDevice& operator=(const UinputDevice&) = delete;

  /// Sends changes. A reader that is too slow loses events, and the kernel reports this to the
  /// reader. The daemon never waits.
  void Show(const HandState& hand);
  /// Path of its device file, such as "/dev/input/event7".
  std::string path() const;

 private:
  struct Handle;

  BoxEvents events_;
  std::unique_ptr<Handle> handle_;
};

}  // namespace torquer::daemon
