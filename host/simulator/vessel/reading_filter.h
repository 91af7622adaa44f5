// Reading filter: the system calls allowed to a process that reads an untrusted file.
#pragma once

namespace torquer::vessel {

/// Limits this process to its memory, its open files and its end. Every other system call fails
/// with EPERM: it cannot open, connect, start or signal anything else. Returns false without effect
/// if the kernel has no such filter.
bool AllowOnlyReading();

}  // namespace torquer::vessel
