// Mutations for fuzz-replay: identical for the same seed on every machine.
#pragma once

#include <random>

#include "tests/fuzz/target.h"

namespace torquer::fuzz {

/// Copy of one of `inputs` (at least one, none empty), changed in one to six places. It is repaired
/// if the target can repair, and has at most target.longest bytes.
Bytes Mutate(const Target& target, const std::vector<Bytes>& inputs, std::mt19937& random);

}  // namespace torquer::fuzz
