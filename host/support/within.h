// Numbers that come from outside, checked where they come in.
#pragma once

#include <fmt/format.h>

#include <string_view>

namespace torquer {

/// Refuses a number that is not from `lowest` to `highest`; one that is not a number is not.
template <class Thrown>
void RequireWithin(std::string_view what, double value, double lowest, double highest) {
  if (value >= lowest && value <= highest) return;
  throw Thrown(fmt::format("{} is {}; give {:g} to {:g}", what, value, lowest, highest));
}

}  // namespace torquer
