// Random numbers for tests of many scenes.
#pragma once

#include <cmath>
#include <random>

namespace torquer::test {

/// Number between two limits.
inline double Between(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

/// Number between two positive limits, evenly over the decades.
inline double Evenly(std::mt19937& random, double low, double high) {
  return std::exp(Between(random, std::log(low), std::log(high)));
}

}  // namespace torquer::test
