#include "host/device/clock_map.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace {

using torquer::device::ClockMap;

// Delays as on a busy machine: mostly tens of us, occasionally milliseconds.
class Delays {
 public:
  double operator()() {
    const double usual = 20.0 * exponential_(random_);
    return uniform_(random_) < 0.02 ? usual + 8000.0 * uniform_(random_) : usual;
  }

 private:
  std::mt19937_64 random_{1};
  std::exponential_distribution<double> exponential_{1.0};
  std::uniform_real_distribution<double> uniform_{0.0, 1.0};
};

}  // namespace

TEST_CASE("Jitter and drift are seen through") {
  const double drift = GENERATE(0.0, 40e-6, -40e-6, 2.5e-3, -2.5e-3);
  Delays delays;
  ClockMap map;
  double worst_us = 0.0;
  double latest_us = 0.0;
  for (int i = 0; i < 120000; ++i) {
    const double true_us = 1e9 + (1.0 + drift) * 1000.0 * i;
    // The queue preserves order: a report never overtakes an earlier one.
    latest_us = std::max(latest_us, true_us + delays());
    const std::int64_t device_us = 123456789 + 1000LL * i;
    const std::int64_t origin_us = map.Map(device_us, static_cast<std::int64_t>(latest_us));
    REQUIRE(origin_us <= static_cast<std::int64_t>(latest_us));
    if (i > 5000) worst_us = std::max(worst_us, std::abs(static_cast<double>(origin_us) - true_us));
  }
  CAPTURE(drift);
  CHECK(worst_us < 25.0);
  REQUIRE(map.drift());
  CHECK(*map.drift() == Approx(drift).margin(2e-6));
  CHECK(map.restarts() == 0);
}

TEST_CASE("Times of sampling never run backwards and never lie after the arrival") {
  Delays delays;
  ClockMap map;
  std::int64_t last_us = 0;
  double latest_us = 0.0;
  for (int i = 0; i < 20000; ++i) {
    latest_us = std::max(latest_us, 1000.0 * i + 30.0 * delays());
    const auto host_us = static_cast<std::int64_t>(latest_us);
    const std::int64_t origin_us = map.Map(1000LL * i, host_us);
    REQUIRE(origin_us >= last_us);
    REQUIRE(origin_us <= host_us);
    last_us = origin_us;
  }
}

TEST_CASE("A clock that jumps is found again") {
  const std::int64_t jump_us = GENERATE(-500000, 500000);
  ClockMap map;
  std::int64_t origin_us = 0;
  for (int i = 0; i < 30000; ++i) {
    const std::int64_t host_us = 1000000 + 1000LL * i + (i >= 15000 ? jump_us : 0);
    origin_us = map.Map(1000LL * i, host_us);
    REQUIRE(origin_us <= host_us);
    // Detection takes at most two blocks of 250 ms; after a jump back it takes the jump's length.
    if (i < 15000 || i > 15600) REQUIRE(origin_us == host_us);
  }
  CHECK(map.restarts() >= 1);
}

TEST_CASE("A device that runs at any speed but that of time is not misread") {
  // An emulator at full speed, and one that the machine cannot keep up with.
  const double speed = GENERATE(3.3, 0.3);
  ClockMap map;
  for (int i = 0; i < 20000; ++i) {
    const auto host_us = static_cast<std::int64_t>(1000.0 * i / speed);
    const std::int64_t origin_us = map.Map(1000LL * i, host_us);
    REQUIRE(origin_us <= host_us);
    REQUIRE(host_us - origin_us < 600000);
  }
}

TEST_CASE("Reset forgets") {
  ClockMap map;
  CHECK_FALSE(map.drift());
  for (int i = 0; i < 5000; ++i) map.Map(1000LL * i, 1000LL * i);
  CHECK(map.drift());
  map.Reset();
  CHECK(map.Map(77, 9000000) == 9000000);
  CHECK_FALSE(map.drift());
}

TEST_CASE("A device clock that stands still is tolerated") {
  ClockMap map;
  for (int i = 0; i < 5000; ++i) {
    const std::int64_t origin_us = map.Map(1000, 1000LL * i);
    REQUIRE(origin_us <= 1000LL * i);
    REQUIRE(origin_us >= 0);
  }
}
