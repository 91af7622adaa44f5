#include "host/support/printable_text.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>

namespace torquer {
namespace {

struct Character {
  std::uint32_t code = 0;
  std::size_t bytes = 0;  // 0: not UTF-8
};

// First character of `text`, which must not be empty.
Character First(std::string_view text) {
  const auto byte = [&](std::size_t k) { return static_cast<std::uint8_t>(text[k]); };
  if (byte(0) < 0x80) return {byte(0), 1};
  // Smallest code for each number of bytes; longer forms of the same code are not UTF-8.
  constexpr std::array<std::uint32_t, 5> kSmallest = {0, 0, 0x80, 0x800, 0x10000};
  const std::size_t bytes = byte(0) >= 0xf0 ? 4 : byte(0) >= 0xe0 ? 3 : 2;
  if (byte(0) < 0xc0 || byte(0) >= 0xf8 || bytes > text.size()) return {};
  std::uint32_t code = byte(0) & (0x7fu >> bytes);
  for (std::size_t k = 1; k < bytes; ++k) {
    if ((byte(k) & 0xc0) != 0x80) return {};
    code = code << 6 | (byte(k) & 0x3fu);
  }
  const bool surrogate = code >= 0xd800 && code < 0xe000;
  if (code < kSmallest[bytes] || code > 0x10ffff || surrogate) return {};
  return {code, bytes};
}

// True if the character is invisible, or changes the display of neighbors.
bool Hides(std::uint32_t code) {
  const auto within = [code](std::uint32_t first, std::uint32_t last) {
    return code >= first && code <= last;
  };
  return within(0x80, 0x9f) || code == 0xad || code == 0x61c || within(0x200b, 0x200f) ||
         within(0x2028, 0x202e) || within(0x2060, 0x206f) || code == 0xfeff ||
         within(0xfff9, 0xfffb) || within(0xe0000, 0xe0fff);
}

}  // namespace

std::string Printable(std::string_view text, std::size_t most_bytes) {
  std::string out;
  while (!text.empty()) {
    const Character first = First(text);
    std::string piece;
    if (first.bytes == 0 || first.code < 0x20 || first.code == 0x7f) {
      piece = fmt::format("\\x{:02x}", static_cast<std::uint8_t>(text[0]));
    } else if (Hides(first.code)) {
      piece = fmt::format("\\u{{{:x}}}", first.code);
    } else {
      piece = text.substr(0, first.bytes);
    }
    if (out.size() + piece.size() > most_bytes) return out + "..";
    out += piece;
    text.remove_prefix(first.bytes == 0 ? 1 : first.bytes);
  }
  return out;
}

}  // namespace torquer
