// Pages by number.
#pragma once

#include <cstdint>

namespace torquer::viewer {

/// An open page, by a number that no other one gets.
using PageId = std::int64_t;

}  // namespace torquer::viewer
