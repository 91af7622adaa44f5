// Counts what this program's C++ code allocates.
#pragma once

#include <cstddef>

namespace torquer::test {

/// Calls of operator new since the program began, by all threads; always 0 under a sanitizer.
size_t AllocationCount();

}  // namespace torquer::test
