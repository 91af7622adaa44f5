// What the picture and the plots of a session have in common: text for SVG, round numbers.
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

namespace torquer {

/// Formats to the end of `out`.
template <class... Values>
void Append(std::string& out, fmt::format_string<Values...> format, Values&&... values) {
  // Not format_to, which compiles all of {fmt} into each source that uses it.
  out += fmt::format(format, std::forward<Values>(values)...);
}

/// The largest of 1, 2 and 5 times a power of ten that is not above `most`, which is finite and
/// > 0: the length of a scale bar, the distance of an axis's ticks.
double RoundBelow(double most);

}  // namespace torquer
