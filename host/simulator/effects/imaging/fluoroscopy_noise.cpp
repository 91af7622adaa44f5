#include "host/simulator/effects/imaging/fluoroscopy_noise.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace torquer::effects {

namespace {

constexpr std::size_t kSteps = 4096;

// Quantiles of the normal distribution, scaled to variance 1.
std::array<float, kSteps> MakeQuantiles() {
  std::array<double, kSteps> quantiles{};
  double squares = 0;
  double x = -5;
  for (std::size_t k = 0; k < kSteps; ++k) {
    const double wanted = (static_cast<double>(k) + 0.5) / kSteps;
    for (int round = 0; round < 100; ++round) {
      const double error = 0.5 * std::erfc(-x / std::numbers::sqrt2) - wanted;
      const double density = std::exp(-x * x / 2) / std::sqrt(2 * std::numbers::pi);
      const double step = error / density;
      x -= std::fmax(-0.5, std::fmin(0.5, step));
      if (std::abs(step) < 1e-12) break;
    }
    quantiles[k] = x;
    squares += x * x;
  }
  std::array<float, kSteps> scaled{};
  const double scale = 1 / std::sqrt(squares / kSteps);
  for (std::size_t k = 0; k < kSteps; ++k) scaled[k] = static_cast<float>(scale * quantiles[k]);
  return scaled;
}

// SplitMix64: Steele, Lea and Flood, "Fast splittable pseudorandom number generators", 2014.
std::uint64_t Mix(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31);
}

}  // namespace

void FillWithNoise(std::uint64_t seed, std::uint64_t picture, float* out, std::size_t count) {
  static const std::array<float, kSteps> quantiles = MakeQuantiles();
  constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15U;
  std::uint64_t state = Mix(Mix(seed * kStep + 1) + picture * kStep);
  constexpr int kBits = 12;
  constexpr std::size_t kAtOnce = 5;
  for (std::size_t i = 0; i < count; i += kAtOnce) {
    std::uint64_t bits = Mix(state += kStep);
    for (std::size_t k = i; k < i + kAtOnce && k < count; ++k) {
      out[k] = quantiles[bits & (kSteps - 1)];
      bits >>= kBits;
    }
  }
}

}  // namespace torquer::effects
