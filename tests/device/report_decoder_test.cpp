#include "host/device/report_decoder.h"

#include <catch2/catch.hpp>
#include <limits>

#include "tests/support/reports.h"

namespace {

using torquer::device::EpochStart;
using torquer::device::ReportDecoder;
using torquer::device::Sample;
using torquer::protocol::InputReport;
using torquer::test::BytesOf;
using torquer::test::Next;
using torquer::test::StillReport;

// A decoder and the host's clock, one report per millisecond.
struct Feed {
  // Feeds the first reports of a connection, in which a gap counts as no loss.
  void Settle(InputReport before) {
    before.sequence = static_cast<std::uint16_t>(before.sequence - 5);
    before.device_time_us -= 5000;
    for (int i = 0; i < 5; ++i) {
      REQUIRE((*this)(before));
      before = Next(before);
    }
  }
  std::optional<Sample> operator()(const InputReport& report, std::int64_t passed_us = 1000) {
    host_us += passed_us;
    return decoder.Decode(BytesOf(report), host_us);
  }
  ReportDecoder decoder;
  std::int64_t host_us = 5000000;
};

InputReport WithSequence(InputReport report, int sequence) {
  const int step = sequence - report.sequence;
  report.sequence = static_cast<std::uint16_t>(sequence);
  report.device_time_us += static_cast<std::uint32_t>(1000 * step);
  return report;
}

}  // namespace

TEST_CASE("The bytes on the wire are decoded as written down") {
  const std::uint8_t bytes[32] = {
      0x01, 0x01, 0x05, 0x2a, 0x06,  // id, version, flags: motion + fault, boot, contrast + clutch
      0x34, 0x12,                    // sequence 0x1234
      0x78, 0x56, 0x34, 0x12,        // device time 0x12345678
      0xfe, 0xff, 0xff, 0xff,        // axial -2
      0x00, 0x01, 0x00, 0x00,        // transverse 256
      0x03, 0x02, 0xff, 0x03,        // joystick 515, 1023
      0x40,                          // surface quality 64
      0x10, 0x20,                    // shutter 0x2010
      0xb0, 0x04,                    // 1200 counts an inch
      0x00, 0x00, 0x00, 0x00};
  ReportDecoder decoder;
  const std::optional<Sample> sample = decoder.Decode(bytes, 77);
  REQUIRE(sample);
  CHECK(sample->receive_us == 77);
  CHECK(sample->device_time_us == 0x12345678);
  CHECK(sample->report_number == 0x1234);
  CHECK(sample->axial_counts == -2);
  CHECK(sample->transverse_counts == 256);
  CHECK(sample->joystick_x == 515);
  CHECK(sample->joystick_y == 1023);
  CHECK(sample->buttons == (torquer::protocol::kButtonContrast | torquer::protocol::kButtonClutch));
  CHECK(sample->flags == (torquer::protocol::kFlagMotion | torquer::protocol::kFlagSensorFault));
  CHECK(sample->surface_quality == 64);
  CHECK(sample->shutter == 0x2010);
  CHECK(sample->cpi == 1200);
  CHECK(sample->boot_id == 0x2a);
  CHECK(sample->epoch_start == EpochStart::kConnected);
}

TEST_CASE("A report of any other length, id or version is refused and counted") {
  Feed feed;
  REQUIRE(feed(StillReport(0)));
  const auto bytes = BytesOf(StillReport(1));
  for (std::size_t length = 0; length < bytes.size(); ++length) {
    CHECK_FALSE(feed.decoder.Decode(std::span(bytes).first(length), 1));
  }
  std::vector<std::uint8_t> overlong(bytes.begin(), bytes.end());
  overlong.push_back(0);
  CHECK_FALSE(feed.decoder.Decode(overlong, 1));
  CHECK(feed.decoder.counters().wrong_length == 33);
  for (int value = 0; value < 256; ++value) {
    if (value == 1) continue;  // both the id and the version
    auto altered = bytes;
    altered[0] = static_cast<std::uint8_t>(value);
    CHECK_FALSE(feed.decoder.Decode(altered, 1));
    altered = bytes;
    altered[1] = static_cast<std::uint8_t>(value);
    CHECK_FALSE(feed.decoder.Decode(altered, 1));
  }
  CHECK(feed.decoder.counters().wrong_id == 255);
  CHECK(feed.decoder.counters().wrong_version == 255);
  CHECK(feed.decoder.counters().received == 1 + 33 + 510);
  // The refused reports have not changed the decoder's state.
  const std::optional<Sample> next = feed(StillReport(1));
  REQUIRE(next);
  CHECK(next->report_number == 1);
  CHECK(feed.decoder.counters().lost == 0);
}

TEST_CASE("Sequence, time and counts go on over their wraps, in both directions") {
  const int direction = GENERATE(1, -1);
  Feed feed;
  InputReport report = StillReport();
  report.sequence = 65530;
  report.device_time_us = std::numeric_limits<std::uint32_t>::max() - 4500;
  const std::int32_t edge = direction > 0 ? std::numeric_limits<std::int32_t>::max()
                                          : std::numeric_limits<std::int32_t>::min();
  report.axial_counts = edge - direction * 100;
  report.transverse_counts = ~edge;
  const std::optional<Sample> first = feed(report);
  REQUIRE(first);
  for (int i = 1; i <= 20; ++i) {
    report = Next(report);
    const auto step = static_cast<std::uint32_t>(direction * 15);
    report.axial_counts =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(report.axial_counts) + step);
    report.transverse_counts =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(report.transverse_counts) - step);
    const std::optional<Sample> sample = feed(report);
    REQUIRE(sample);
    CHECK(sample->epoch_start == EpochStart::kNone);
    CHECK(sample->report_number - first->report_number == i);
    CHECK(sample->device_time_us - first->device_time_us == 1000 * i);
    CHECK(sample->axial_counts - first->axial_counts == direction * 15 * i);
    CHECK(sample->transverse_counts - first->transverse_counts == -direction * 15 * i);
  }
  CHECK(feed.decoder.counters().lost == 0);
  CHECK(feed.decoder.counters().jumps == 0);
}

TEST_CASE("Lost reports are counted and lose no motion") {
  Feed feed;
  InputReport report = StillReport(65533);
  feed.Settle(report);
  REQUIRE(feed(report));
  report = WithSequence(report, 65533 + 7);  // over the wrap: 65534 .. 3 are missing
  report.axial_counts = 700;
  const std::optional<Sample> sample = feed(report, 7000);
  REQUIRE(sample);
  CHECK(sample->axial_counts == 700);
  CHECK(sample->report_number == 65540);
  CHECK(feed.decoder.counters().lost == 6);
}

TEST_CASE("A gap longer than the sequence is measured by the clocks") {
  Feed feed;
  InputReport report = StillReport(10);
  feed.Settle(report);
  REQUIRE(feed(report));
  SECTION("more than one wrap of the sequence") {
    report = WithSequence(report, 10 + 2 * 65536 + 5);
    const std::optional<Sample> sample = feed(report, 1000LL * (2 * 65536 + 5));
    REQUIRE(sample);
    CHECK(sample->report_number == 10 + 2 * 65536 + 5);
    CHECK(feed.decoder.counters().lost == 2 * 65536 + 4);
  }
  SECTION("more than one wrap of the device clock") {
    constexpr std::int64_t kReports = 10000000;  // 2.8 hours
    report.sequence = static_cast<std::uint16_t>(report.sequence + kReports);
    report.device_time_us = static_cast<std::uint32_t>(report.device_time_us + 1000 * kReports);
    // The device's clock is off by 100 ppm.
    const std::optional<Sample> sample = feed(report, 1000 * kReports + kReports / 10);
    REQUIRE(sample);
    CHECK(sample->report_number == 10 + kReports);
    CHECK(feed.decoder.counters().lost == kReports - 1);
  }
}

TEST_CASE("Duplicates and late reports are distinguished and ignored") {
  Feed feed;
  InputReport report = StillReport(65535);
  feed.Settle(report);
  REQUIRE(feed(report));
  CHECK_FALSE(feed(report));
  CHECK(feed.decoder.counters().duplicated == 1);

  InputReport newer = WithSequence(report, 65535 + 3);
  newer.axial_counts = 30;
  REQUIRE(feed(newer));
  CHECK(feed.decoder.counters().lost == 2);

  InputReport late = WithSequence(report, 65535 + 1);
  late.axial_counts = 10;
  CHECK_FALSE(feed(late));
  CHECK(feed.decoder.counters().reordered == 1);
  CHECK(feed.decoder.counters().lost == 1);
  CHECK_FALSE(feed(late));  // the second time it is recognized
  CHECK(feed.decoder.counters().reordered == 1);
  CHECK(feed.decoder.counters().duplicated == 2);
  CHECK_FALSE(feed(report));
  CHECK(feed.decoder.counters().duplicated == 3);

  InputReport next = WithSequence(report, 65535 + 4);
  next.axial_counts = 40;
  const std::optional<Sample> sample = feed(next);
  REQUIRE(sample);
  CHECK(sample->axial_counts == 40);
  CHECK(feed.decoder.counters().lost == 1);
}

TEST_CASE("A restarted or reconnected device continues without a jump") {
  Feed feed;
  InputReport report = StillReport(100);
  report.axial_counts = 5000;
  report.transverse_counts = -300;
  const std::optional<Sample> before = feed(report);
  REQUIRE(before);
  const bool reset = GENERATE(true, false);
  if (reset) {
    report = StillReport(0);
    report.boot_id = 8;
  } else {
    feed.decoder.OnConnected();
    report = WithSequence(report, 9000);
    report.axial_counts = 7777;
  }
  const std::optional<Sample> after = feed(report, 2500000);
  REQUIRE(after);
  CHECK(after->epoch_start == (reset ? EpochStart::kReset : EpochStart::kConnected));
  CHECK(after->axial_counts == before->axial_counts);
  CHECK(after->transverse_counts == before->transverse_counts);
  CHECK(after->report_number == before->report_number + 1);
  CHECK(after->device_time_us == before->device_time_us + 2500000);
  report = Next(report);
  report.axial_counts += 25;
  const std::optional<Sample> next = feed(report);
  REQUIRE(next);
  CHECK(next->epoch_start == EpochStart::kNone);
  CHECK(next->axial_counts == before->axial_counts + 25);
  CHECK(feed.decoder.counters().lost == 0);
  CHECK(feed.decoder.counters().resets == (reset ? 1 : 0));
}

TEST_CASE("A report from before a restart does not disturb the new epoch") {
  Feed feed;
  REQUIRE(feed(StillReport(100)));
  InputReport restarted = StillReport(0);
  restarted.boot_id = 8;
  REQUIRE(feed(restarted));
  CHECK_FALSE(feed(WithSequence(restarted, -1)));  // never sent in this epoch
  CHECK(feed.decoder.counters().reordered == 1);
  CHECK(feed.decoder.counters().lost == 0);
}

TEST_CASE("Counts that no hand could move begin again from where they are") {
  Feed feed;
  InputReport report = StillReport();
  report.axial_counts = 100000;
  const std::optional<Sample> before = feed(report);
  report = Next(report);
  report.axial_counts = 0;  // the device began to count from zero again
  const std::optional<Sample> after = feed(report);
  REQUIRE(after);
  CHECK(after->axial_counts == before->axial_counts);
  CHECK(after->epoch_start == EpochStart::kJump);
  CHECK(feed.decoder.counters().jumps == 1);
  // A hand can move at 1 m/s: 47 counts per report at 1200 cpi. Ten times that is accepted too.
  report = Next(report);
  report.axial_counts += 470;
  CHECK(feed(report)->axial_counts == before->axial_counts + 470);
  CHECK(feed.decoder.counters().jumps == 1);
}

TEST_CASE("Reports from before a connection count neither as loss nor as motion") {
  Feed feed;
  feed.decoder.OnConnected();
  REQUIRE(feed(StillReport(10)));  // held in the device's two banks since power-on
  REQUIRE(feed(StillReport(11)));
  InputReport now = WithSequence(StillReport(11), 31234);
  now.axial_counts = 900;
  const std::optional<Sample> first = feed(now);
  REQUIRE(first);
  CHECK(first->epoch_start == EpochStart::kConnected);
  CHECK(first->axial_counts == 0);
  CHECK(feed.decoder.counters().lost == 0);
  for (int i = 0; i < 4; ++i) {
    now = Next(now);
    now.axial_counts += 10;
    REQUIRE(feed(now));
  }
  // From here on a gap counts as a loss.
  now = WithSequence(now, now.sequence + 3);
  now.axial_counts += 10;
  const std::optional<Sample> behind = feed(now, 3000);
  REQUIRE(behind);
  CHECK(behind->epoch_start == EpochStart::kNone);
  CHECK(behind->axial_counts == 50);
  CHECK(feed.decoder.counters().lost == 2);
}

TEST_CASE("The end switch's count continues with the axial count, over wraps and restarts") {
  Feed feed;
  InputReport report = StillReport();
  report.axial_counts = std::numeric_limits<std::int32_t>::max() - 10;
  feed.Settle(report);
  const std::int64_t mark = std::numeric_limits<std::int32_t>::max() + std::int64_t{5};
  for (int i = 0; i < 30; ++i) {
    report = Next(report);
    report.axial_counts =
        static_cast<std::int32_t>(static_cast<std::uint32_t>(report.axial_counts) + 1u);
    if (i >= 15) report.reference_counts = std::numeric_limits<std::int32_t>::min() + 4;
    const auto sample = feed(report);
    REQUIRE(sample);
    if (i >= 15) CHECK(sample->reference_counts == mark);
  }
  // After a restart the device counts from 0; the decoder continues from its last position.
  ++report.boot_id;
  report.axial_counts = 100;
  report.reference_counts = 70;
  const auto sample = feed(Next(report));
  REQUIRE(sample);
  CHECK(sample->axial_counts - sample->reference_counts == 30);
}
