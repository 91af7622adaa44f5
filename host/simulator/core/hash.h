// FNV-1a by 64-bit words over the exact bits of numbers: eight times fewer steps than by bytes, and
// it runs every tick. A product carries bits upwards alone, so the upper half is brought down after
// each: without that, two numbers that change their sign leave the hash as it is.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <cstring>
#include <vector>

namespace torquer {

inline constexpr std::uint64_t kHashSeed = 0xcbf29ce484222325ULL;

inline std::uint64_t HashWord(std::uint64_t word, std::uint64_t seed) {
  const std::uint64_t mixed = (seed ^ word) * 0x100000001b3ULL;
  return mixed ^ (mixed >> 32U);
}

inline std::uint64_t HashDouble(double value, std::uint64_t seed) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return HashWord(bits, seed);
}

template <class Vector>
std::uint64_t HashVectors(const std::vector<Vector>& vectors, std::uint64_t seed) {
  for (const Vector& v : vectors) {
    for (const double component : v) seed = HashDouble(component, seed);
  }
  return seed;
}

}  // namespace torquer
