// SVG text and round numbers, shared by the picture and the plots of a session.
#pragma once

#include <fmt/format.h>

#include <string>
#include <utility>

namespace torquer {

/// Appends formatted text to `out`.
template <class... Values>
void Append(std::string& out, fmt::format_string<Values...> format, Values&&... values) {
  // Not format_to, which compiles all of {fmt} into each source that uses it.
  out += fmt::format(format, std::forward<Values>(values)...);
}

/// Largest of 1, 2 and 5 times a power of ten that is not above `most` (finite, > 0). Used for the
/// length of a scale bar and the distance of axis ticks.
double RoundBelow(double most);

}  // namespace torquer
