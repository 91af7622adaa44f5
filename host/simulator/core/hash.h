// FNV-1a by 64-bit words over the exact bits of numbers: eight times fewer steps than by bytes, and
// it runs every tick.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <vector>

namespace torquer {

inline constexpr std::uint64_t kHashSeed = 0xcbf29ce484222325ULL;

inline std::uint64_t HashDouble(double value, std::uint64_t seed) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return (seed ^ bits) * 0x100000001b3ULL;
}

template <class Vector>
std::uint64_t HashVectors(const std::vector<Vector>& vectors, std::uint64_t seed) {
  for (const Vector& v : vectors) {
    for (const double component : v) seed = HashDouble(component, seed);
  }
  return seed;
}

}  // namespace torquer
