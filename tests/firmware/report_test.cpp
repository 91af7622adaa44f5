#include "firmware/src/report.h"

#include <catch2/catch.hpp>
#include <cstring>
#include <limits>
#include <string>

#include "firmware/src/boot_id.h"
#include "firmware/src/serial_number.h"
#include "protocol/eeprom_layout.h"
#include "tests/firmware/fake_board.h"

namespace torquer::firmware {
namespace {

/// Surface motion by `axial` counts in distal direction and `transverse` counts right-handed. The
/// board of the sensor that sees it lies along the pipe.
MotionSample Moved(int axial, int transverse) {
  MotionSample sample;
  sample.delta_y = static_cast<std::int16_t>(axial);
  sample.delta_x = static_cast<std::int16_t>(-transverse);
  return sample;
}

protocol::InputReport Next(ReportBuilder* builder, const MotionSample& sample) {
  builder->Count(sample);
  return builder->Next(0, 0, 0, 0, 1200, ReferenceSwitch(), false);
}

TEST_CASE("a report has the readings") {
  ReportBuilder builder;
  builder.SetBootId(9);
  MotionSample sample = Moved(3, -4);
  sample.motion = true;
  sample.lifted = true;
  sample.surface_quality = 77;
  sample.shutter = 1234;
  builder.Count(sample);
  CHECK(builder.axial_counts() == 3);
  protocol::InputReport report =
      builder.Next(0xfffffffe, protocol::kButtonClutch, 1, 1022, 800, ReferenceSwitch(), false);
  CHECK(report.report_id == protocol::kInputReportId);
  CHECK(report.protocol_version == protocol::kProtocolVersion);
  CHECK(report.flags == (protocol::kFlagMotion | protocol::kFlagLift));
  CHECK(report.boot_id == 9);
  CHECK(report.buttons == protocol::kButtonClutch);
  CHECK(report.device_time_us == 0xfffffffe);
  CHECK(report.axial_counts == 3);
  CHECK(report.transverse_counts == -4);
  CHECK(report.joystick_x == 1);
  CHECK(report.joystick_y == 1022);
  CHECK(report.surface_quality == 77);
  CHECK(report.shutter == 1234);
  CHECK(report.cpi == 800);
  CHECK(report.reference_counts == 0);

  ReferenceSwitch reference;
  for (int i = 0; i < 20; ++i) reference.Update(false, false, 0);
  reference.Update(true, false, -17);
  reference.Update(true, true, -20);
  builder.Count(MotionSample());
  report = builder.Next(0, 0, 0, 0, 0, reference, true);
  CHECK(report.flags ==
        (protocol::kFlagReference | protocol::kFlagAtReference | protocol::kFlagSromLost));
  CHECK(report.reference_counts == -17);
}

TEST_CASE("counts wrap in both directions") {
  ReportBuilder builder;
  // 65,538 steps of 32,767 end one below 2^31 - 1.
  for (int i = 0; i < 65538; ++i) Next(&builder, Moved(32767, -32767));
  const protocol::InputReport report = Next(&builder, Moved(3, -4));
  CHECK(report.axial_counts == std::numeric_limits<std::int32_t>::min() + 1);
  CHECK(report.transverse_counts == std::numeric_limits<std::int32_t>::max() - 1);
}

TEST_CASE("the farthest that a sensor can count in a frame is counted") {
  ReportBuilder builder;
  MotionSample sample;
  sample.delta_x = std::numeric_limits<std::int16_t>::min();
  sample.delta_y = std::numeric_limits<std::int16_t>::min();
  const protocol::InputReport report = Next(&builder, sample);
  CHECK(report.axial_counts == -32768);
  CHECK(report.transverse_counts == 32768);
}

TEST_CASE("the sequence grows by one and wraps") {
  ReportBuilder builder;
  std::uint16_t last = Next(&builder, {}).sequence;
  for (int i = 0; i < 70000; ++i) {
    const std::uint16_t sequence = Next(&builder, {}).sequence;
    REQUIRE(sequence == static_cast<std::uint16_t>(last + 1));
    last = sequence;
  }
}

TEST_CASE("zero resets only the counts") {
  ReportBuilder builder;
  Next(&builder, Moved(5, 6));
  builder.Zero();
  const protocol::InputReport report = Next(&builder, Moved(1, 2));
  CHECK(report.axial_counts == 1);
  CHECK(report.transverse_counts == 2);
  CHECK(report.sequence == 2);
}

TEST_CASE("every boot has another id than the one before, after any cause of a reset") {
  NewBoard();
  std::uint8_t last = NextBootId();
  for (int power_on = 0; power_on < 300; ++power_on) {
    for (int reset = 0; reset < power_on % 20; ++reset) {
      const std::uint8_t id = NextBootId();
      REQUIRE(id != last);
      last = id;
    }
    board().warm_byte.reset();  // the power fails
    const std::uint8_t id = NextBootId();
    REQUIRE(id != last);
    last = id;
  }
}

TEST_CASE("only a power-on writes the EEPROM, one byte") {
  NewBoard();
  NextBootId();
  CHECK(board().eeprom_writes == 1);
  for (int i = 0; i < 10; ++i) NextBootId();
  CHECK(board().eeprom_writes == 1);
}

std::string Serial() {
  char serial[kSerialBytes];
  ReadSerialNumber(serial);
  return std::string(serial, strnlen(serial, sizeof(serial)));
}

void GiveSerial(const std::string& text) {
  protocol::SerialRecord record{};
  text.copy(record.serial, sizeof(record.serial));
  record.crc = protocol::Crc16(record.serial, sizeof(record.serial));
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&record);
  std::copy(bytes, bytes + sizeof(record), board().eeprom.begin() + protocol::kEepromSerialAddress);
}

TEST_CASE("a given serial number is used, full length included") {
  NewBoard();
  GiveSerial("BOX-42");
  CHECK(Serial() == "BOX-42");
  GiveSerial("0123456789ABCDEF");
  CHECK(Serial() == "0123456789ABCDEF");
}

TEST_CASE("without a valid one the number comes from the chip, and else is zero") {
  NewBoard();
  const std::string own = Serial();
  CHECK(own.substr(0, 3) == "TQ-");
  CHECK(own.size() == 11);
  GiveSerial("BOX-42");
  board().eeprom[protocol::kEepromSerialAddress] ^= 1;
  CHECK(Serial() == own);
  GiveSerial("has space");
  CHECK(Serial() == own);
  GiveSerial("");
  CHECK(Serial() == own);
  board().chip_serial[9] ^= 1;
  CHECK(Serial() != own);
  board().chip_serial.fill(0xff);
  CHECK(Serial() == "TQ-00000000");
}

}  // namespace
}  // namespace torquer::firmware
