// Order in which a front meets the contacts of several pairs of curves, from the tips on.
#pragma once

#include <cstddef>
#include <vector>

namespace torquer {

/// Chooses the pair of curves whose most distal group is next. `left`: groups of each pair that are
/// not yet in the order. A pair waits for another one that touches one of its curves beyond it.
/// Curves within each other never all wait for each other; if those beside each other do, they come
/// last. Returns the number of pairs if no group is left. `Pairs`: LumenPairs or BetweenCurves.
template <class Pairs>
std::size_t NextPair(const std::vector<Pairs>& pairs, const std::vector<int>& left) {
  const auto next = [&](std::size_t k) {
    return pairs[k].groups[static_cast<std::size_t>(left[k]) - 1];
  };
  // Segment of a curve in the next group of a pair, or -1.
  const auto segment_on = [&](std::size_t k, int curve) {
    if (left[k] == 0) return -1;
    if (pairs[k].inner == curve) return next(k).inner;
    return pairs[k].outer == curve ? next(k).outer : -1;
  };
  std::size_t chosen = pairs.size();
  bool chosen_waits_beside_only = false;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (left[k] == 0) continue;
    bool waits = false;
    bool waits_within = pairs[k].beside;
    for (std::size_t m = 0; m < pairs.size(); ++m) {
      if (segment_on(m, pairs[k].inner) <= next(k).inner &&
          segment_on(m, pairs[k].outer) <= next(k).outer) {
        continue;
      }
      waits = true;
      waits_within = waits_within || !pairs[m].beside;
    }
    if (!waits) return k;
    if (chosen == pairs.size() || (!waits_within && !chosen_waits_beside_only)) {
      chosen = k;
      chosen_waits_beside_only = !waits_within;
    }
  }
  return chosen;
}

}  // namespace torquer
