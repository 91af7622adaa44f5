// Random numbers that are the same on every machine and with every compiler.
#pragma once

#include <cassert>
#include <cmath>
#include <cstdint>
#include <random>

namespace torquer {

/// The standard defines the numbers of std::mt19937_64, but not of std::uniform_real_distribution
/// and similar classes; these are implemented here. The same seed gives the same numbers. Only the
/// last bit of Normal() depends on the C library's logarithm.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}

  /// 64 random bits.
  std::uint64_t Next() { return engine_(); }

  /// Uniform in [low, high), in steps of 2^-53 of the range.
  double Uniform(double low = 0.0, double high = 1.0) {
    return low + (high - low) * (static_cast<double>(Next() >> 11) * 0x1p-53);
  }

  /// Uniformly distributed integer in [low, high].
  std::int64_t Integer(std::int64_t low, std::int64_t high) {
    assert(low <= high);
    const auto base = static_cast<std::uint64_t>(low);
    const std::uint64_t count = static_cast<std::uint64_t>(high) - base + 1;  // 0: 2^64
    if (count == 0) return static_cast<std::int64_t>(Next());
    // The numbers below 2^64 mod `count` would make small results more likely.
    const std::uint64_t unfair = (0 - count) % count;
    std::uint64_t number = Next();
    while (number < unfair) number = Next();
    return static_cast<std::int64_t>(base + number % count);
  }

  /// True with this probability, 0 .. 1.
  bool Chance(double probability) { return Uniform() < probability; }

  /// Normally distributed with mean 0 and standard deviation 1 (Marsaglia's polar method, SIAM
  /// Review 6, 1964, 260).
  double Normal() {
    double x = 0.0;
    double square = 0.0;
    do {
      x = Uniform(-1.0, 1.0);
      const double y = Uniform(-1.0, 1.0);
      square = x * x + y * y;
    } while (square >= 1.0 || square == 0.0);
    return x * std::sqrt(-2.0 * std::log(square) / square);
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace torquer
