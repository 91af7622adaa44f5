// Single definition of the bootloader's feature reports, as hid_reports.h is for the firmware. The
// ids differ from those of the firmware, so that neither accepts a report for the other.
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "protocol/eeprom_layout.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_descriptor.h"

namespace torquer {
namespace protocol {

/// Version of the layouts in this file. A bootloader is installed once and stays, so this number is
/// independent of kProtocolVersion.
constexpr uint8_t kBootloaderProtocolVersion = 1;

enum BootloaderReportId : uint8_t {
  kBootloaderStatusReportId = 16,
  kPageReportId = 17,
  kBootloaderCommandReportId = 18,
};

// clang-format off
#define TORQUER_BOOTLOADER_STATUS_REPORT(FIELD)                                                    \
  FIELD(uint8_t,  report_id,          "16")                                                        \
  FIELD(uint8_t,  protocol_version,   "kBootloaderProtocolVersion")                                \
  FIELD(uint8_t,  board,              "ImageBoard")                                                \
  FIELD(uint8_t,  clock,              "ClockCode() of crystal and CPU that it was built for")      \
  FIELD(ImageTrailer, trailer,        "as it lies in the flash, valid or not")                     \
  FIELD(uint8_t,  application_valid,  "1 if the application would be started, else 0")             \
  FIELD(SerialRecord, given_serial,   "as it lies in the EEPROM")                                  \
  FIELD_ARRAY(uint8_t, chip_serial, 10, "lot, wafer and position of the chip")                     \
  FIELD_ARRAY(uint8_t, spare, 3,      "0")

#define TORQUER_PAGE_REPORT(FIELD)                                                                 \
  FIELD(uint8_t,  report_id,          "17")                                                        \
  FIELD(uint8_t,  spare,              "0")                                                         \
  FIELD(uint16_t, address,            "first byte of the page, a multiple of 128")                 \
  FIELD_ARRAY(uint8_t, data, 128,     "the page")

#define TORQUER_BOOTLOADER_COMMAND_REPORT(FIELD)                                                   \
  FIELD(uint8_t,  report_id,          "18")                                                        \
  FIELD(uint8_t,  command,            "BootloaderCommand")                                         \
  FIELD(uint16_t, key,                "kCommandKey, else the report is stalled")                   \
  FIELD(uint16_t, address,            "address of the page to select; else 0")                     \
  FIELD_ARRAY(uint8_t, spare, 2,      "0")
// clang-format on

#define TORQUER_FIELD(type, name, meaning) type name;
#define FIELD_ARRAY(type, name, count, meaning) type name[count];
/// Read only: identity of the bootloader, and the state of the application. MakeSerialNumber()
/// makes the serial number.
struct __attribute__((packed)) BootloaderStatusReport {
  TORQUER_BOOTLOADER_STATUS_REPORT(TORQUER_FIELD)
};
/// A write erases and programs the page before the report is acknowledged. The first page makes the
/// application invalid, and the page of the trailer makes it valid again. A trailer that does not
/// match the application or the board gets a stall, and the flash does not change. A read returns
/// the selected page, and selects the next one.
struct __attribute__((packed)) PageReport {
  TORQUER_PAGE_REPORT(TORQUER_FIELD)
};
/// Write only.
struct __attribute__((packed)) BootloaderCommandReport {
  TORQUER_BOOTLOADER_COMMAND_REPORT(TORQUER_FIELD)
};
#undef TORQUER_FIELD
#undef FIELD_ARRAY

/// Values of BootloaderCommandReport::command.
enum BootloaderCommand : uint8_t {
  kBootloaderSelectPage = 1,  ///< the page to be read next
  kBootloaderRestart = 2,     ///< reset: the application starts if it is valid
};

static_assert(sizeof(BootloaderStatusReport) == 52, "see the byte table in README.md");
static_assert(sizeof(PageReport) == 4 + kFlashPageBytes, "see the byte table in README.md");
static_assert(sizeof(BootloaderCommandReport) == 8, "see the byte table in README.md");

#define TORQUER_FEATURE_ITEMS(id, report)          \
  0x85, (id),                   /* Report ID */    \
      0x09, (id),               /* Usage */        \
      0x95, sizeof(report) - 1, /* Report Count */ \
      0xb1, 0x02                /* Feature (data, variable, absolute) */
// clang-format off
/// Report descriptor, as returned by GET_DESCRIPTOR(HID report).
constexpr uint8_t kBootloaderReportDescriptor[] TORQUER_IN_FLASH = {
    0x06, kHidUsagePage & 0xff, kHidUsagePage >> 8,  // Usage Page (vendor)
    0x09, 0x02,                                      // Usage
    0xa1, 0x01,                                      // Collection (application)
    0x15, 0x00,                                      //   Logical Minimum 0
    0x26, 0xff, 0x00,                                //   Logical Maximum 255
    0x75, 0x08,                                      //   Report Size 8 bits
    TORQUER_FEATURE_ITEMS(kBootloaderStatusReportId, BootloaderStatusReport),
    TORQUER_FEATURE_ITEMS(kPageReportId, PageReport),
    TORQUER_FEATURE_ITEMS(kBootloaderCommandReportId, BootloaderCommandReport),
    0xc0,                                            // End Collection
};
// clang-format on
#undef TORQUER_FEATURE_ITEMS

static_assert(sizeof(kBootloaderReportDescriptor) == 39, "HID class descriptor carries it");

}  // namespace protocol
}  // namespace torquer
