// What a process may ask of the kernel that reads a file from anywhere.
#pragma once

namespace torquer::vessel {

/// From here on this process may use its memory and the files that it has open, and end. Every
/// other system call fails with EPERM: it opens, connects, starts and signals nothing. False, and
/// nothing is changed, where the kernel has no such filter.
bool AllowOnlyReading();

}  // namespace torquer::vessel
