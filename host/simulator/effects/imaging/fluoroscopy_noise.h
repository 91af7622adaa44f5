// Repeatable quantum noise: the same seed and picture number give the same noise.
#pragma once

#include <cstdint>

namespace torquer::effects {

/// Fills with independent Gaussian numbers of mean 0 and variance 1 (in 4096 steps, up to 3.7).
void FillWithNoise(std::uint64_t seed, std::uint64_t picture, float* out, std::size_t count);

}  // namespace torquer::effects
