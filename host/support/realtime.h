// Real-time scheduling on request.
#pragma once

namespace torquer {

/// Gives this thread, and those that it starts, priority over all ordinary ones (SCHED_FIFO). Also
/// locks the process's memory in RAM (mlockall). Makes all of these changes or none. Throws
/// UserError naming the limit that forbids it, and the remedy.
void EnterRealtime();

/// Makes this thread an ordinary one again, for work that may take longer than a tick. Has no
/// effect without EnterRealtime.
void LeaveRealtime() noexcept;

}  // namespace torquer
