// What the picture and the plots of a session have in common: text for SVG and HTML, round numbers.
#pragma once

#include <fmt/format.h>

#include <iterator>
#include <string>
#include <string_view>
#include <utility>

namespace torquer {

/// Formats to the end of `out`.
template <class... Values>
void Append(std::string& out, fmt::format_string<Values...> format, Values&&... values) {
  fmt::format_to(std::back_inserter(out), format, std::forward<Values>(values)...);
}

/// `text` with the characters that mean something in HTML and XML replaced: for text between tags,
/// and for values of attributes in double quotes.
std::string EscapeMarkup(std::string_view text);

/// The largest of 1, 2 and 5 times a power of ten that is not above `most`, which is finite and
/// > 0: the length of a scale bar, the distance of an axis's ticks.
double RoundBelow(double most);

}  // namespace torquer
