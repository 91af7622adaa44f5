// Golden bytes on the wire, written by hand: a change of layout or byte order fails here.
#include <catch2/catch.hpp>
#include <cstring>
#include <string>
#include <vector>

#include "protocol/bootloader_reports.h"
#include "protocol/eeprom_layout.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_descriptor.h"
#include "protocol/hid_reports.h"
#include "protocol/serial_number.h"
#include "protocol/usb_ids.h"

namespace torquer::protocol {
namespace {

using Bytes = std::vector<int>;

template <typename Report>
Bytes BytesOf(const Report& report) {
  unsigned char raw[sizeof(Report)];
  std::memcpy(raw, &report, sizeof(Report));
  return Bytes(raw, raw + sizeof(Report));
}

TEST_CASE("an input report has these 32 bytes") {
  InputReport report{};
  report.report_id = kInputReportId;
  report.protocol_version = kProtocolVersion;
  report.flags = kFlagMotion | kFlagSensorFault | kFlagReference | kFlagAtReference | kFlagSromLost;
  report.boot_id = 0x2a;
  report.buttons = kButtonXray | kButtonClutch;
  report.sequence = 0x1234;
  report.device_time_us = 0x89abcdef;
  report.axial_counts = -2;
  report.transverse_counts = 0x01020304;
  report.joystick_x = 1023;
  report.joystick_y = 512;
  report.surface_quality = 0x55;
  report.shutter = 0x0607;
  report.cpi = 1200;
  report.reference_counts = -3;
  CHECK(BytesOf(report) == Bytes{0x01, 0x01, 0x3d, 0x2a, 0x05, 0x34, 0x12, 0xef, 0xcd, 0xab, 0x89,
                                 0xfe, 0xff, 0xff, 0xff, 0x04, 0x03, 0x02, 0x01, 0xff, 0x03, 0x00,
                                 0x02, 0x55, 0x07, 0x06, 0xb0, 0x04, 0xfd, 0xff, 0xff, 0xff});
}

TEST_CASE("an identity report has these 32 bytes") {
  IdentityReport report{};
  report.report_id = kIdentityReportId;
  report.protocol_version = kProtocolVersion;
  report.firmware_major = 1;
  report.firmware_minor = 2;
  report.firmware_patch = 3;
  report.sensor_product_id = 0x42;
  report.sensor_revision = 1;
  report.crystal_mhz = 16;
  std::memcpy(report.serial, "TQ-1", 4);
  report.self_test = 7;
  report.board = 1;
  report.capabilities = 0x1f;
  report.cpu_mhz = 8;
  report.second_product_id = 0x47;
  report.second_revision = 2;
  CHECK(BytesOf(report) == Bytes{2, 1, 1, 2, 3, 0x42, 1, 16, 'T', 'Q', '-', '1', 0,    0, 0, 0,
                                 0, 0, 0, 0, 0, 0,    0, 0,  7,   1,   31,  8,   0x47, 2, 0, 0});
}

TEST_CASE("a configuration report has these 16 bytes") {
  ConfigurationReport report{};
  report.report_id = kConfigurationReportId;
  report.protocol_version = kProtocolVersion;
  report.cpi = 12000;
  report.joystick_deadzone = 511;
  report.closed_at_rest = kButtonXray | kButtonClutch;
  CHECK(BytesOf(report) == Bytes{3, 1, 0xe0, 0x2e, 0xff, 0x01, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0});
}

TEST_CASE("a diagnostics report has these 32 bytes") {
  DiagnosticsReport report{};
  report.report_id = kDiagnosticsReportId;
  report.protocol_version = kProtocolVersion;
  report.reset_reason = 8;
  report.srom_id = 0x04;
  report.sensor_faults = 0x0102;
  report.frames_missed = 0x0304;
  report.settings_writes = 0x0506;
  report.stack_headroom = 0x0708;
  report.longest_frame_us = 0x090a;
  report.sensor_resets = 0x0b0c;
  report.sensor_fault_cause = kSensorReset;
  report.sensor_observation = 0x7f;
  report.joystick_rest_x = 0x0200;
  report.joystick_rest_y = 0x01ff;
  report.supply_mv = 0x0d0e;
  report.second_faults = 0x1011;
  report.second_resets = 0x1213;
  report.second_fault_cause = kSensorSilent;
  report.second_observation = 0x3f;
  CHECK(BytesOf(report) == Bytes{4,    1,    8,    4,    2,    1,    4,    3,    6, 5,    8,
                                 7,    0x0a, 9,    0x0c, 0x0b, 3,    0x7f, 0x00, 2, 0xff, 1,
                                 0x0e, 0x0d, 0x11, 0x10, 0x13, 0x12, 1,    0x3f, 0, 0});
}

TEST_CASE("a command report has these 8 bytes") {
  CommandReport report{};
  report.report_id = kCommandReportId;
  report.command = kCommandEnterBootloader;
  report.key = kCommandKey;
  CHECK(BytesOf(report) == Bytes{5, 2, 0x54, 0x71, 0, 0, 0, 0});
}

TEST_CASE(
    "a firmware image follows its report's id, in one control transfer of at most 4096 bytes") {
  SromReport report{};
  report.report_id = kSromReportId;
  report.image[0] = 0xaa;
  report.image[4093] = 0xbb;
  const Bytes bytes = BytesOf(report);
  REQUIRE(bytes.size() == 4095);
  CHECK(bytes[0] == 6);
  CHECK(bytes[1] == 0xaa);
  CHECK(bytes[4094] == 0xbb);
  CHECK(kLongestReportBytes == 4095);
}

TEST_CASE("a picture report has its pixels from 6") {
  PictureReport report{};
  report.report_id = kPictureReportId;
  report.protocol_version = kProtocolVersion;
  report.surface_quality = 64;
  report.shutter = 0x0102;
  report.pixels[0] = 0x7f;
  report.pixels[1295] = 0x01;
  const Bytes bytes = BytesOf(report);
  REQUIRE(bytes.size() == 1302);
  CHECK(Bytes(bytes.begin(), bytes.begin() + 7) == Bytes{7, 1, 64, 0, 2, 1, 0x7f});
  CHECK(bytes[1301] == 1);
}

TEST_CASE("the report descriptor has these 81 bytes") {
  CHECK(Bytes(std::begin(kHidReportDescriptor), std::end(kHidReportDescriptor)) ==
        Bytes{0x06, 0x00, 0xff, 0x09, 0x01, 0xa1, 0x01, 0x15, 0x00, 0x26, 0xff,
              0x00, 0x75, 0x08, 0x85, 0x01, 0x09, 0x02, 0x95, 31,   0x81, 0x02,  //
              0x85, 0x02, 0x09, 0x03, 0x95, 31,   0xb1, 0x02,                    //
              0x85, 0x03, 0x09, 0x04, 0x95, 15,   0xb1, 0x02,                    //
              0x85, 0x04, 0x09, 0x05, 0x95, 31,   0xb1, 0x02,                    //
              0x85, 0x05, 0x09, 0x06, 0x95, 7,    0xb1, 0x02,                    //
              0x85, 0x06, 0x09, 0x07, 0x96, 0xfe, 0x0f, 0xb1, 0x02,              //
              0x85, 0x07, 0x09, 0x08, 0x96, 0x15, 0x05, 0xb1, 0x02,              //
              0x85, 0x08, 0x09, 0x09, 0x95, 31,   0x81, 0x02,                    //
              0xc0});
}

ImageTrailer SomeTrailer() {
  ImageTrailer trailer{};
  trailer.magic = kImageMagic;
  trailer.length = 0x1234;
  trailer.board = kBoardBenchAtmega32u4;
  trailer.clock = 16;
  trailer.firmware_major = 1;
  trailer.firmware_minor = 2;
  trailer.firmware_patch = 3;
  trailer.protocol_version = 4;
  trailer.crc = 0x89abcdef;
  return trailer;
}

TEST_CASE("an image trailer has these 16 bytes") {
  CHECK(BytesOf(SomeTrailer()) ==
        Bytes{'T', 'Q', 'F', 'W', 0x34, 0x12, 1, 16, 1, 2, 3, 4, 0xef, 0xcd, 0xab, 0x89});
}

TEST_CASE("a bootloader's status report has these 52 bytes") {
  BootloaderStatusReport report{};
  report.report_id = kBootloaderStatusReportId;
  report.protocol_version = kBootloaderProtocolVersion;
  report.board = kBoardBenchAtmega32u4;
  report.clock = 8;
  report.trailer = SomeTrailer();
  report.application_valid = 1;
  std::memcpy(report.given_serial.serial, "TQ-1", 4);
  report.given_serial.crc = 0x0506;
  report.chip_serial[9] = 0x77;
  CHECK(BytesOf(report) ==
        Bytes{16,   1,    1,    8,    'T', 'Q', 'F', 'W', 0x34, 0x12, 1, 16, 1, 2, 3, 4,  //
              0xef, 0xcd, 0xab, 0x89, 1,   'T', 'Q', '-', '1',  0,    0, 0,  0, 0, 0, 0,  //
              0,    0,    0,    0,    0,   6,   5,   0,   0,    0,    0, 0,  0, 0, 0, 0,  //
              0x77, 0,    0,    0});
}

TEST_CASE("a page report has its address at 2 and the page from 4") {
  PageReport report{};
  report.report_id = kPageReportId;
  report.address = 0x6f80;
  report.data[0] = 0xaa;
  report.data[127] = 0xbb;
  const Bytes bytes = BytesOf(report);
  REQUIRE(bytes.size() == 132);
  CHECK(Bytes(bytes.begin(), bytes.begin() + 5) == Bytes{17, 0, 0x80, 0x6f, 0xaa});
  CHECK(bytes[131] == 0xbb);
}

TEST_CASE("a bootloader's command report has these 8 bytes") {
  BootloaderCommandReport report{};
  report.report_id = kBootloaderCommandReportId;
  report.command = kBootloaderRestart;
  report.key = kCommandKey;
  report.address = 0x0180;
  CHECK(BytesOf(report) == Bytes{18, 2, 0x54, 0x71, 0x80, 0x01, 0, 0});
}

TEST_CASE("the bootloader's report descriptor has these 39 bytes") {
  CHECK(Bytes(std::begin(kBootloaderReportDescriptor), std::end(kBootloaderReportDescriptor)) ==
        Bytes{0x06, 0x00, 0xff, 0x09, 0x02, 0xa1, 0x01, 0x15, 0x00, 0x26, 0xff,
              0x00, 0x75, 0x08, 0x85, 16,   0x09, 16,   0x95, 51,   0xb1, 0x02,  //
              0x85, 17,   0x09, 17,   0x95, 131,  0xb1, 0x02,                    //
              0x85, 18,   0x09, 18,   0x95, 7,    0xb1, 0x02,                    //
              0xc0});
}

TEST_CASE("the CRC of an image is CRC-32 of the application and the trailer's other bytes") {
  const std::string text = "123456789";
  std::uint32_t crc = kCrc32Start;
  for (const char c : text) crc = Crc32Step(crc, static_cast<std::uint8_t>(c));
  CHECK((crc ^ kCrc32Xor) == 0xcbf43926);

  // Application and trailer as one string: "12345" and the twelve bytes.
  ImageTrailer trailer = SomeTrailer();
  trailer.length = 5;
  const auto read = [&text](std::uint16_t at) { return static_cast<std::uint8_t>(text[at]); };
  trailer.crc = ImageCrc(trailer, read);
  CHECK(ImageIsWhole(trailer, read));
  std::uint32_t other = kCrc32Start;
  for (const int byte :
       Bytes{'1', '2', '3', '4', '5', 'T', 'Q', 'F', 'W', 5, 0, 1, 16, 1, 2, 3, 4}) {
    other = Crc32Step(other, static_cast<std::uint8_t>(byte));
  }
  CHECK(trailer.crc == (other ^ kCrc32Xor));
  trailer.firmware_patch ^= 1;
  CHECK_FALSE(ImageIsWhole(trailer, read));
  trailer.firmware_patch ^= 1;
  trailer.length = 0;
  trailer.crc = ImageCrc(trailer, read);
  CHECK_FALSE(ImageIsWhole(trailer, read));
}

TEST_CASE("a serial number is the one given, else made of the chip's own") {
  SerialRecord given{};
  std::memcpy(given.serial, "HELLO", 5);
  given.crc = Crc16(given.serial, sizeof(given.serial));
  std::uint8_t chip[kChipSerialBytes] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  char serial[kSerialBytes + 1] = {};
  MakeSerialNumber(given, chip, serial);
  CHECK(std::string(serial) == "HELLO");
  given.crc ^= 1;
  MakeSerialNumber(given, chip, serial);
  CHECK(std::string(serial) == "TQ-93043FD7");
  std::memset(chip, 0xff, sizeof(chip));
  MakeSerialNumber(given, chip, serial);
  CHECK(std::string(serial) == "TQ-00000000");
}

TEST_CASE("the CRC of the EEPROM records is CRC-16/CCITT-FALSE") {
  CHECK(Crc16("123456789", 9) == 0x29b1);
}

TEST_CASE("an input report fits one packet of its endpoint") {
  CHECK(sizeof(InputReport) <= 64);
  CHECK(kControlPacketBytes == 32);
  CHECK(kUsbVendorId == 0x1209);
}

}  // namespace
}  // namespace torquer::protocol
