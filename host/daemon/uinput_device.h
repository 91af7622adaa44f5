// The box as an input device of this machine, for software that knows nothing of Torquer: made by
// the kernel's uinput, on request.
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

/// What the hand does, as events: REL_Z insertion and REL_RZ rotation of the instrument, ABS_X and
/// ABS_Y the stick (0 .. 1023), BTN_TRIGGER X-ray, BTN_THUMB contrast, BTN_THUMB2 clutch. The sums
/// of the relative axes are the motion since the first state, rounded once. No I/O.
class BoxEvents {
 public:
  /// The events that lead from the state before to this one; none where nothing changed. The place
  /// in the first state, and in the first after a new start, is no motion.
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
  /// Makes the device, named `name`, until this is destroyed. Throws UserError where the user may
  /// not, or the kernel has no uinput.
  explicit UinputDevice(const std::string& name);
  ~UinputDevice();
  UinputDevice(const UinputDevice&) = delete;
  UinputDevice& operator=(const UinputDevice&) = delete;

  /// Sends what has changed. A reader that is too slow loses events, and the kernel reports that to
  /// it; the daemon never waits.
  void Show(const HandState& hand);
  /// Its file, "/dev/input/event7".
  std::string path() const;

 private:
  struct Handle;

  BoxEvents events_;
  std::unique_ptr<Handle> handle_;
};

}  // namespace torquer::daemon
