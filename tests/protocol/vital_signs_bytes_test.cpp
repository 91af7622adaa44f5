// Golden bytes of vital_signs_t on the bus: big-endian, in the order of its fields.
#include <bit>
#include <catch2/catch.hpp>
#include <cstdint>
#include <string>
#include <torquer_lcm/vital_signs_t.hpp>
#include <vector>

#include "protocol/lcm_channels.h"

namespace torquer::protocol {
namespace {

class Expected {
 public:
  Expected& Integer(std::uint64_t value, int size) {
    for (int k = size - 1; k >= 0; --k) bytes.push_back(static_cast<std::uint8_t>(value >> 8 * k));
    return *this;
  }
  Expected& Double(double value) { return Integer(std::bit_cast<std::uint64_t>(value), 8); }
  Expected& Float(float value) { return Integer(std::bit_cast<std::uint32_t>(value), 4); }
  std::vector<std::uint8_t> bytes;
};

TEST_CASE("vital_signs_t has its golden bytes") {
  torquer_lcm::vital_signs_t vitals{};
  vitals.tick = 17;
  vitals.time_s = 0.5;
  vitals.clock_id = 3;
  vitals.publish_us = 1'000'001;
  vitals.heart_rate_per_min = 70;
  vitals.beat_s = 0.25;
  vitals.systolic_mmHg = 120.5;
  vitals.diastolic_mmHg = 80;
  vitals.mean_mmHg = 93;
  vitals.wedged = 1;
  vitals.alarms = kAlarmPressureDamped | kAlarmRateHigh;
  vitals.rate_limits_per_min[0] = 50;
  vitals.rate_limits_per_min[1] = 60;
  vitals.systolic_limits_mmHg[0] = 90;
  vitals.systolic_limits_mmHg[1] = 160;
  vitals.sample_s = 0.004;
  vitals.first_sample = 258;
  vitals.sample_count = 2;
  vitals.ecg = {1, -0.25};
  vitals.pressure_mmHg = {119, 118.5};
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(vitals.getEncodedSize()));
  vitals.encode(bytes.data(), 0, static_cast<int>(bytes.size()));

  // The first number is LCM's hash of the fields. Another one is another type, with which earlier
  // logs and programs do not agree.
  Expected expected;
  expected.Integer(0x73033b81dc2bc96d, 8)
      .Integer(17, 8)
      .Double(0.5)
      .Integer(3, 8)
      .Integer(1'000'001, 8);
  expected.Double(70).Double(0.25).Double(120.5).Double(80).Double(93);
  expected.Integer(1, 1).Integer(18, 4).Double(50).Double(60).Double(90).Double(160);
  expected.Double(0.004).Integer(258, 8).Integer(2, 4);
  expected.Float(1).Float(-0.25F).Float(119).Float(118.5F);
  CHECK(bytes == expected.bytes);
}

}  // namespace
}  // namespace torquer::protocol
