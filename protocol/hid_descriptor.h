// HID report descriptor of the bench device: one vendor-defined collection with the input report
// and the feature reports. The structs in hid_reports.h give their lengths.
//
// Usable under avr-gcc, where the bytes live in flash and are read with pgm_read_byte.
#pragma once

#include <stdint.h>

#include "protocol/hid_reports.h"

#if defined(__AVR__)
#define TORQUER_IN_FLASH __attribute__((__progmem__))
#else
#define TORQUER_IN_FLASH
#endif

namespace torquer {
namespace protocol {

/// Vendor-defined usage page and the usages on it: 1 the device, then one for each report id.
constexpr uint16_t kHidUsagePage = 0xff00;
constexpr uint8_t kHidDeviceUsage = 0x01;

// Report id, usage, and a field of (report bytes - 1) octets; the id itself is not in the count.
#define TORQUER_REPORT_ITEMS(id, report, main_item) \
  0x85, (id),                   /* Report ID */     \
      0x09, (id) + 1,           /* Usage */         \
      0x95, sizeof(report) - 1, /* Report Count */  \
      (main_item), 0x02         /* Input or Feature (data, variable, absolute) */
// The same for a report of more than 256 bytes, whose count has two bytes.
#define TORQUER_LONG_REPORT_ITEMS(id, report, main_item)                               \
  0x85, (id),                                                       /* Report ID */    \
      0x09, (id) + 1,                                               /* Usage */        \
      0x96, (sizeof(report) - 1) & 0xff, (sizeof(report) - 1) >> 8, /* Report Count */ \
      (main_item), 0x02                                             /* Feature */
// clang-format off
/// Report descriptor, as returned by GET_DESCRIPTOR(HID report).
constexpr uint8_t kHidReportDescriptor[] TORQUER_IN_FLASH = {
    0x06, kHidUsagePage & 0xff, kHidUsagePage >> 8,  // Usage Page (vendor)
    0x09, kHidDeviceUsage,                           // Usage
    0xa1, 0x01,                                      // Collection (application)
    0x15, 0x00,                                      //   Logical Minimum 0
    0x26, 0xff, 0x00,                                //   Logical Maximum 255
    0x75, 0x08,                                      //   Report Size 8 bits
    TORQUER_REPORT_ITEMS(kInputReportId, InputReport, 0x81),
    TORQUER_REPORT_ITEMS(kIdentityReportId, IdentityReport, 0xb1),
    TORQUER_REPORT_ITEMS(kConfigurationReportId, ConfigurationReport, 0xb1),
    TORQUER_REPORT_ITEMS(kDiagnosticsReportId, DiagnosticsReport, 0xb1),
    TORQUER_REPORT_ITEMS(kCommandReportId, CommandReport, 0xb1),
    TORQUER_LONG_REPORT_ITEMS(kSromReportId, SromReport, 0xb1),
    TORQUER_LONG_REPORT_ITEMS(kPictureReportId, PictureReport, 0xb1),
    TORQUER_REPORT_ITEMS(kSecondInputReportId, InputReport, 0x81),
    0xc0,                                            // End Collection
};
// clang-format on
#undef TORQUER_REPORT_ITEMS
#undef TORQUER_LONG_REPORT_ITEMS

static_assert(sizeof(kHidReportDescriptor) == 81, "HID class descriptor carries this length");

}  // namespace protocol
}  // namespace torquer
