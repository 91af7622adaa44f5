#include "host/support/time_histogram.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <vector>

namespace torquer::test {
namespace {

TEST_CASE("Quantiles of a histogram are those of the sorted times, to 1 %") {
  std::mt19937 random(GENERATE(1, 2, 3));
  const int count = GENERATE(1, 7, 1000, 100'000);
  std::lognormal_distribution<double> draw(3, 2);
  TimeHistogram histogram;
  std::vector<double> all;
  for (int k = 0; k < count; ++k) {
    all.push_back(draw(random) + 0.1);
    histogram.Add(all.back());
  }
  std::sort(all.begin(), all.end());
  CHECK(histogram.count() == count);
  CHECK(histogram.largest_us() == all.back());
  for (const double share : {0.001, 0.5, 0.99, 0.999, 1.0}) {
    const auto rank = static_cast<std::size_t>(std::ceil(share * count));
    REQUIRE(histogram.Quantile(share));
    CHECK(*histogram.Quantile(share) == Approx(all[rank - 1]).epsilon(0.0101));
  }
}

TEST_CASE("A histogram takes any time, and is empty at first") {
  TimeHistogram histogram;
  CHECK_FALSE(histogram.Quantile(0.5));
  CHECK_FALSE(histogram.largest_us());
  for (const double us : {0.0, 1e-9, 5e9, 1e300}) histogram.Add(us);
  CHECK(histogram.count() == 4);
  CHECK(*histogram.Quantile(0.25) < 0.11);
  CHECK(*histogram.Quantile(1) > 9e8);
  CHECK(histogram.largest_us() == 1e300);
}

}  // namespace
}  // namespace torquer::test
