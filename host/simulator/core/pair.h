// Two doubles in one register, for loops whose cost is their instruction count.
//
// Eigen's three-component matrices leave half of a register empty. A pair instead holds the same
// component of both columns of a tangent frame. The lanes are computed as scalars would be, so the
// bits are the same on every machine.
#pragma once

#include <cstring>

namespace torquer {

using Pair = double __attribute__((vector_size(16)));

inline Pair Load(const double* two) {
  Pair v;
  std::memcpy(&v, two, sizeof v);
  return v;
}
inline void Store(Pair v, double* two) { std::memcpy(two, &v, sizeof v); }
inline Pair Both(double x) { return Pair{x, x}; }
inline Pair Swapped(Pair v) { return __builtin_shufflevector(v, v, 1, 0); }
inline Pair Firsts(Pair a, Pair b) { return __builtin_shufflevector(a, b, 0, 2); }
inline Pair Seconds(Pair a, Pair b) { return __builtin_shufflevector(a, b, 1, 3); }
/// Sum of the lanes, in both lanes.
inline Pair Summed(Pair v) { return v + Swapped(v); }
/// Sums of the lanes of a and of b.
inline Pair Sums(Pair a, Pair b) { return Firsts(a, b) + Seconds(a, b); }

}  // namespace torquer
