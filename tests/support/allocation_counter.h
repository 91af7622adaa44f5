// Allocation counter for this program's C++ code.
#pragma once

#include <cstddef>

namespace torquer::test {

/// Number of calls of operator new since the program started, in all threads; always 0 under a
/// sanitizer.
size_t AllocationCount();

}  // namespace torquer::test
