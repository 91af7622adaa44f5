// Numbers from text, the same in every locale.
#pragma once

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace torquer {

/// Parses a finite decimal number that is all of `text`, such as "-1.5", "+2" or "1e-3". Returns
/// nullopt for other texts ("", "1 mm", "nan", "0x10", "1e999").
inline std::optional<double> ParseNumber(std::string_view text) {
  // std::from_chars takes no plus sign.
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

}  // namespace torquer
