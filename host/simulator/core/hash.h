// FNV-1a hash by 64-bit words over the exact bits of numbers. It runs every tick, and words take an
// eighth of the steps of bytes. A product carries bits only upwards, so each step folds the upper
// half down. Without that, two sign changes would leave the hash unchanged.
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
