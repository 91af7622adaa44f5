#include "host/support/random.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

using torquer::Random;

TEST_CASE("Random numbers are the same on every machine", "[support]") {
  // Check value of std::mt19937_64 in the standard ([rand.predef]): the 10000th number of the
  // default seed.
  Random standard(5489);
  for (int i = 1; i < 10000; ++i) standard.Next();
  CHECK(standard.Next() == 9981545732273789042u);

  // Results derived from the first two numbers of seed 1.
  Random one(1);
  constexpr std::uint64_t kTopBits = 2469588189546311528u / 2048;
  CHECK(one.Uniform() == static_cast<double>(kTopBits) / 9007199254740992.0);
  CHECK(one.Integer(0, 9) == 2516265689700432462u % 10);
}

TEST_CASE("Uniform numbers fill their range evenly", "[support]") {
  Random random(7);
  constexpr int kDraws = 200000;
  std::array<int, 20> bins{};
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Uniform(-3.0, 5.0);
    REQUIRE(x >= -3.0);
    REQUIRE(x < 5.0);
    ++bins[static_cast<std::size_t>((x + 3.0) / 8.0 * 20.0)];
  }
  // Chi-squared with 19 degrees of freedom exceeds 43.8 once in a thousand.
  double chi_squared = 0.0;
  for (const int count : bins) chi_squared += std::pow(count - kDraws / 20.0, 2) / (kDraws / 20.0);
  CHECK(chi_squared < 43.8);
}

TEST_CASE("Integers reach both ends, each as often", "[support]") {
  Random random(8);
  constexpr int kDraws = 70000;
  std::array<int, 7> bins{};
  for (int i = 0; i < kDraws; ++i) ++bins[static_cast<std::size_t>(random.Integer(-2, 4) + 2)];
  double chi_squared = 0.0;
  for (const int count : bins) chi_squared += std::pow(count - kDraws / 7.0, 2) / (kDraws / 7.0);
  CHECK(chi_squared < 22.5);  // 6 degrees of freedom, once in a thousand
  CHECK(random.Integer(5, 5) == 5);
  // A range of 3/4 of all 64-bit numbers. With a plain modulo, a third of the results would be
  // twice as likely as the others.
  constexpr std::int64_t kHigh = 0x5fffffffffffffff;
  int low_third = 0;
  for (int i = 0; i < kDraws; ++i)
    low_third += random.Integer(-0x6000000000000000, kHigh) < -0x2000000000000000;
  CHECK(std::abs(low_third - kDraws / 3.0) < 4.0 * std::sqrt(kDraws * 2.0 / 9.0));
}

TEST_CASE("Normal numbers have the moments of the normal distribution", "[support]") {
  Random random(9);
  constexpr int kDraws = 400000;
  double sum = 0.0;
  double squares = 0.0;
  double fourth = 0.0;
  int beyond_two = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.Normal();
    sum += x;
    squares += x * x;
    fourth += x * x * x * x;
    beyond_two += std::abs(x) > 2.0;
  }
  // Tolerances of four standard errors.
  CHECK(std::abs(sum / kDraws) < 4.0 * std::sqrt(1.0 / kDraws));
  CHECK(std::abs(squares / kDraws - 1.0) < 4.0 * std::sqrt(2.0 / kDraws));
  CHECK(std::abs(fourth / kDraws - 3.0) < 4.0 * std::sqrt(96.0 / kDraws));
  CHECK(std::abs(beyond_two / static_cast<double>(kDraws) - 0.045500263896) <
        4.0 * std::sqrt(0.0455 * 0.9545 / kDraws));
}

TEST_CASE("A chance occurs with its probability", "[support]") {
  Random random(10);
  int taken = 0;
  for (int i = 0; i < 100000; ++i) taken += random.Chance(0.03);
  CHECK(std::abs(taken - 3000) < 4.0 * std::sqrt(100000 * 0.03 * 0.97));
  for (int i = 0; i < 1000; ++i) {
    REQUIRE_FALSE(random.Chance(0.0));
    REQUIRE(random.Chance(1.0));
  }
}
