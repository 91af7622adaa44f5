// Position from which a starting daemon continues.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host/daemon/claim.h"
#include "host/daemon/hand_tracker.h"

namespace torquer::daemon {

/// Largest age of the previous daemon's last command from which a daemon continues.
inline constexpr int kTakeUpWithinS = 600;

struct StartPosition {
  Pose pose;
  std::string from;           ///< sender of the position, for messages; empty at zero
  std::int64_t sequence = 0;  ///< of the first command
};

/// Finds the position of an instrument from the simulator, if one is on the bus at `url`. Otherwise
/// the position is that of the previous daemon's last command, or zero. Listens for 0.4 s. Throws
/// UserError when the instrument already gets commands, or the simulator on the bus does not have
/// it.
StartPosition FindStart(const std::string& instrument, std::optional<LastCommand> previous,
                        const std::string& url);

}  // namespace torquer::daemon
