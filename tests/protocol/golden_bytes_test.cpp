// The bytes on the wire, written out by hand: a change of layout or byte order fails here.
#include <catch2/catch.hpp>
#include <cstring>
#include <vector>

#include "protocol/eeprom_layout.h"
#include "protocol/hid_descriptor.h"
#include "protocol/hid_reports.h"
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
  report.flags = kFlagMotion | kFlagSensorFault;
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
  CHECK(BytesOf(report) == Bytes{0x01, 0x01, 0x05, 0x2a, 0x05, 0x34, 0x12, 0xef, 0xcd, 0xab, 0x89,
                                 0xfe, 0xff, 0xff, 0xff, 0x04, 0x03, 0x02, 0x01, 0xff, 0x03, 0x00,
                                 0x02, 0x55, 0x07, 0x06, 0xb0, 0x04, 0x00, 0x00, 0x00, 0x00});
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
  report.clock_mhz = 16;
  std::memcpy(report.serial, "TQ-1", 4);
  report.self_test = 7;
  CHECK(BytesOf(report) == Bytes{2, 1, 1, 2, 3, 0x42, 1, 16, 'T', 'Q', '-', '1', 0, 0, 0, 0,
                                 0, 0, 0, 0, 0, 0,    0, 0,  7,   0,   0,   0,   0, 0, 0, 0});
}

TEST_CASE("a configuration report has these 16 bytes") {
  ConfigurationReport report{};
  report.report_id = kConfigurationReportId;
  report.protocol_version = kProtocolVersion;
  report.cpi = 12000;
  report.joystick_deadzone = 511;
  CHECK(BytesOf(report) == Bytes{3, 1, 0xe0, 0x2e, 0xff, 0x01, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0});
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
  CHECK(BytesOf(report) == Bytes{4, 1, 8, 4, 2, 1, 4, 3, 6, 5, 8, 7, 0x0a, 9, 0, 0,
                                 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,    0, 0, 0});
}

TEST_CASE("a command report has these 8 bytes") {
  CommandReport report{};
  report.report_id = kCommandReportId;
  report.command = kCommandEnterBootloader;
  report.key = kCommandKey;
  CHECK(BytesOf(report) == Bytes{5, 2, 0x54, 0x71, 0, 0, 0, 0});
}

TEST_CASE("the report descriptor has these 55 bytes") {
  CHECK(Bytes(std::begin(kHidReportDescriptor), std::end(kHidReportDescriptor)) ==
        Bytes{0x06, 0x00, 0xff, 0x09, 0x01, 0xa1, 0x01, 0x15, 0x00, 0x26, 0xff,
              0x00, 0x75, 0x08, 0x85, 0x01, 0x09, 0x02, 0x95, 31,   0x81, 0x02,  //
              0x85, 0x02, 0x09, 0x03, 0x95, 31,   0xb1, 0x02,                    //
              0x85, 0x03, 0x09, 0x04, 0x95, 15,   0xb1, 0x02,                    //
              0x85, 0x04, 0x09, 0x05, 0x95, 31,   0xb1, 0x02,                    //
              0x85, 0x05, 0x09, 0x06, 0x95, 7,    0xb1, 0x02,                    //
              0xc0});
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
