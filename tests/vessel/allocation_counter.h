// Counts what this program's C++ code allocates.
#pragma once

#include <cstddef>

namespace torquer::vessel {

/// Calls of operator new since the program began, by all threads.
size_t AllocationCount();

}  // namespace torquer::vessel
