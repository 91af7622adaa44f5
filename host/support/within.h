// Range check of numbers from outside.
#pragma once

#include <fmt/format.h>

#include <string_view>

namespace torquer {

/// Throws `Thrown` if a number is NaN or outside of `lowest` to `highest`.
template <class Thrown>
void RequireWithin(std::string_view what, double value, double lowest, double highest) {
  if (value >= lowest && value <= highest) return;
  throw Thrown(fmt::format("{} is {}; give {:g} to {:g}", what, value, lowest, highest));
}

}  // namespace torquer
