// Real-time scheduling, for who asks for it.
#pragma once

namespace torquer {

/// From now on this thread, and those that it starts, come before all ordinary ones (SCHED_FIFO),
/// and the process's memory stays in RAM (mlockall). All or nothing. Throws UserError naming the
/// limit that forbids it, and the remedy.
void EnterRealtime();

/// This thread is an ordinary one again: for work that may take longer than a tick. Does nothing
/// without EnterRealtime.
void LeaveRealtime() noexcept;

}  // namespace torquer
