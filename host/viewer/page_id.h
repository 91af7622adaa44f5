// Pages by number.
#pragma once

#include <cstdint>

namespace torquer::viewer {

/// Unique number of an open page.
using PageId = std::int64_t;

}  // namespace torquer::viewer
