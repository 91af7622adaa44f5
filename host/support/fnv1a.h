// FNV-1a, 64 bits: a checksum against torn and altered data (not against malice).
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace torquer {

/// FNV-1a of the bytes; pass an earlier result as `hash` to continue it over more bytes.
constexpr std::uint64_t Fnv1a(std::string_view bytes, std::uint64_t hash = 0xcbf29ce484222325u) {
  for (const char byte : bytes) {
    hash ^= static_cast<unsigned char>(byte);
    hash *= 0x100000001b3u;
  }
  return hash;
}

/// Text of a hash for all outputs: 16 hexadecimal digits.
inline std::string Hex(std::uint64_t value) { return fmt::format("{:016x}", value); }

}  // namespace torquer
