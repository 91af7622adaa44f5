// Message check: bytes from a bus or a log that are not a valid message are refused before
// decoding. Under AddressSanitizer these tests also show that no byte beyond the message is read.
#include "host/bus/message_check.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <limits>
#include <random>
#include <set>
#include <stdexcept>
#include <torquer_lcm/readings_t.hpp>

#include "tests/support/paths.h"
#include "tests/support/sample_messages.h"
#include "tests/support/sanitizer.h"

using torquer::test::Bytes;
using torquer::test::SampleMessage;

namespace {

constexpr std::size_t kFingerprint = 8;

void PutInt32(Bytes& bytes, std::size_t at, std::int32_t value) {
  for (std::size_t k = 0; k < 4; ++k) {
    bytes[at + k] = static_cast<std::uint8_t>(static_cast<std::uint32_t>(value) >> (24 - 8 * k));
  }
}

}  // namespace

TEST_CASE("Every type of protocol/lcm that has a channel is among the samples") {
  std::set<std::string> types;
  for (const auto& file :
       std::filesystem::directory_iterator(torquer::test::SourcePath("/protocol/lcm"))) {
    types.insert(file.path().stem());
  }
  types.erase("instrument_state_t");  // a part of another
  std::set<std::string> sampled;
  for (const SampleMessage& sample : torquer::test::SampleMessages()) sampled.insert(sample.type);
  CHECK(sampled == types);
}

TEST_CASE("Whole messages of every type decode, and no part or extension of one") {
  for (const SampleMessage& sample : torquer::test::SampleMessages()) {
    CAPTURE(sample.type);
    CHECK(sample.decodes(sample.bytes));
    for (std::size_t size = 0; size < sample.bytes.size(); ++size) {
      const Bytes cut(sample.bytes.begin(),
                      sample.bytes.begin() + static_cast<std::ptrdiff_t>(size));
      if (sample.decodes(cut)) FAIL("decodes after " << size << " bytes");
    }
    Bytes longer = sample.bytes;
    longer.push_back(0);
    CHECK_FALSE(sample.decodes(longer));
    Bytes other = sample.bytes;
    other[3] ^= 1;
    CHECK_FALSE(sample.decodes(other));
  }
}

TEST_CASE("Hostile lengths and counts at every place are refused or harmless") {
  // Each of these values overwrites a length, a count or part of a number in turn.
  const std::vector<std::int32_t> hostile = {0,          -1,         1,          INT32_MIN,
                                             INT32_MAX,  0x20000000, 0x20000001, 0x10000000,
                                             0x40000000, 0x55555556, -536870912, 65536};
  for (const SampleMessage& sample : torquer::test::SampleMessages()) {
    CAPTURE(sample.type);
    for (std::size_t at = kFingerprint; at + 4 <= sample.bytes.size(); ++at) {
      for (const std::int32_t value : hostile) {
        Bytes bytes = sample.bytes;
        PutInt32(bytes, at, value);
        REQUIRE_NOTHROW(sample.decodes(bytes));
      }
    }
  }
}

TEST_CASE("Mutated messages of every type are refused, or are what their encoder makes") {
  std::mt19937 random(20261122);
  const auto below = [&random](std::size_t n) { return static_cast<std::size_t>(random()) % n; };
  int decoded = 0;
  int refused = 0;
  for (const SampleMessage& sample : torquer::test::SampleMessages()) {
    CAPTURE(sample.type);
    for (int round = 0; round < torquer::test::Rounds(20000, 10); ++round) {
      Bytes bytes = sample.bytes;
      for (std::size_t change = 0; change <= below(4); ++change) {
        const std::size_t at = kFingerprint + below(bytes.size() - kFingerprint);
        switch (below(4)) {
          case 0:
            bytes[at] = static_cast<std::uint8_t>(random());
            break;
          case 1:
            bytes[at] = static_cast<std::uint8_t>(bytes[at] ^ 1u << below(8));
            break;
          case 2:
            bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(at));
            break;
          default:
            bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), {0, 0, 0, 1});
        }
        if (bytes.size() <= kFingerprint + 1) break;
      }
      (sample.decodes(bytes) ? decoded : refused) += 1;
    }
  }
  // Both kinds must occur, or the mutations have no effect.
  CHECK(decoded > 1000 / (torquer::test::kUnderSanitizer ? 10 : 1));
  CHECK(refused > 1000 / (torquer::test::kUnderSanitizer ? 10 : 1));
}

TEST_CASE("Random bytes behind a fingerprint are refused") {
  std::mt19937 random(7);
  for (const SampleMessage& sample : torquer::test::SampleMessages()) {
    CAPTURE(sample.type);
    for (int round = 0; round < torquer::test::Rounds(5000, 10); ++round) {
      Bytes bytes(sample.bytes.begin(), sample.bytes.begin() + kFingerprint);
      bytes.resize(kFingerprint + random() % 400);
      for (std::size_t k = kFingerprint; k < bytes.size(); ++k) {
        bytes[k] = static_cast<std::uint8_t>(random());
      }
      REQUIRE_NOTHROW(sample.decodes(bytes));
    }
  }
}

TEST_CASE("An event that has not happened has no time, also in readings of earlier releases") {
  torquer_lcm::readings_t readings{};
  readings.names = {"target_reached",    "target_reached_s", "wall_force_event_s", "mask_lost_s",
                    "wall_force_events", "air_kerma_mGy",    "injection_start_s"};
  const double unknown = std::numeric_limits<double>::quiet_NaN();
  readings.values = {0, -1, -1, -1, unknown, -1, 0};
  readings.count = static_cast<std::int32_t>(readings.names.size());
  Bytes bytes(static_cast<std::size_t>(readings.getEncodedSize()));
  readings.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  torquer_lcm::readings_t decoded;
  REQUIRE(torquer::bus::DecodeMessage(bytes.data(), bytes.size(), decoded));
  for (const std::size_t k : {1, 2, 3}) CHECK(std::isnan(decoded.values[k]));
  // These are no times of events, or a time.
  for (const std::size_t k : {0, 5, 6}) CHECK(decoded.values[k] == readings.values[k]);
  using torquer::bus::NeverHappened;
  CHECK(NeverHappened(decoded, "target_reached_s"));
  CHECK(NeverHappened(decoded, "mask_lost_s"));
  CHECK_FALSE(NeverHappened(decoded, "wall_force_event_s"));  // their number is not known
  CHECK_FALSE(NeverHappened(decoded, "left_model_event_s"));  // the scene does not look for them
  CHECK_FALSE(NeverHappened(decoded, "injection_start_s"));
}

TEST_CASE("A text has its zero at its end, and no other") {
  torquer_lcm::readings_t readings{};
  readings.names = {"abc"};
  readings.values = {1};
  readings.count = 1;
  Bytes bytes(static_cast<std::size_t>(readings.getEncodedSize()));
  readings.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  const auto decodes = [](const Bytes& some) {
    torquer_lcm::readings_t message;
    return torquer::bus::DecodeMessage(some.data(), some.size(), message);
  };
  CHECK(decodes(bytes));
  const std::size_t text = bytes.size() - 8 - 4;  // before the value: "abc" and its zero
  REQUIRE(bytes[text] == 'a');
  bytes[text + 3] = 'd';
  CHECK_FALSE(decodes(bytes));
  bytes[text + 3] = 0;
  bytes[text + 1] = 0;
  CHECK_FALSE(decodes(bytes));
}

TEST_CASE("A type that protocol/lcm does not define is an error of the program") {
  CHECK_THROWS_AS(torquer::bus::IsMessage("nonsense_t", 0, {}), std::logic_error);
}
