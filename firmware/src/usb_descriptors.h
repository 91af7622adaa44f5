// USB descriptors, in flash: the data that the host reads at enumeration.
#pragma once

#include <stdint.h>

#include "firmware/src/version.h"
#include "protocol/hid_descriptor.h"
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

namespace torquer {
namespace firmware {

/// Descriptor types of USB 2.0 and HID 1.11.
enum DescriptorType : uint8_t {
  kDeviceDescriptorType = 0x01,
  kConfigurationDescriptorType = 0x02,
  kStringDescriptorType = 0x03,
  kInterfaceDescriptorType = 0x04,
  kEndpointDescriptorType = 0x05,
  kHidDescriptorType = 0x21,
  kHidReportDescriptorType = 0x22,
};

enum StringIndex : uint8_t {
  kLanguagesString = 0,
  kManufacturerString = 1,
  kProductString = 2,
  kSerialString = 3,
};

constexpr uint8_t Low(uint16_t value) { return static_cast<uint8_t>(value & 0xff); }
constexpr uint8_t High(uint16_t value) { return static_cast<uint8_t>(value >> 8); }

// clang-format off
constexpr uint8_t kDeviceDescriptor[] TORQUER_IN_FLASH = {
    18, kDeviceDescriptorType,
    0x00, 0x02,                    // USB 2.0
    0, 0, 0,                       // class: by interface
    protocol::kControlPacketBytes,
    Low(protocol::kUsbVendorId), High(protocol::kUsbVendorId),
    Low(protocol::kUsbProductId), High(protocol::kUsbProductId),
    (kVersionMinor << 4) | kVersionPatch, kVersionMajor,  // BCD
    kManufacturerString, kProductString, kSerialString,
    1,                             // configurations
};

constexpr uint8_t kHidDescriptorOffset = 18;
constexpr uint8_t kHidDescriptorBytes = 9;
constexpr uint8_t kConfigurationDescriptor[] TORQUER_IN_FLASH = {
    9, kConfigurationDescriptorType,
    34, 0,                         // total length
    1,                             // interfaces
    1,                             // the value that selects it
    0,
    0x80 | 0x20,                   // powered by the bus, wakes the host
    100 / 2,                       // mA / 2

    9, kInterfaceDescriptorType,
    0, 0,                          // interface 0, no alternate
    1,                             // endpoints besides 0
    0x03, 0, 0,                    // HID, no boot protocol
    0,

    9, kHidDescriptorType,
    0x11, 0x01,                    // HID 1.11
    0,                             // no country
    1, kHidReportDescriptorType,
    Low(sizeof(protocol::kHidReportDescriptor)), High(sizeof(protocol::kHidReportDescriptor)),

    7, kEndpointDescriptorType,
    0x80 | protocol::kInputEndpoint,
    0x03,                          // interrupt
    sizeof(protocol::InputReport), 0,
    protocol::kInputIntervalMs,
};
static_assert(sizeof(kConfigurationDescriptor) == 34, "its own total length field");

/// A string descriptor of `N - 1` ASCII characters.
template <uint16_t N>
struct StringDescriptor {
  uint8_t bytes[2 * N];
};
template <uint16_t N>
constexpr StringDescriptor<N> MakeStringDescriptor(const char (&text)[N]) {
  StringDescriptor<N> descriptor = {};
  descriptor.bytes[0] = 2 * N;
  descriptor.bytes[1] = kStringDescriptorType;
  for (uint16_t i = 0; i + 1 < N; ++i) descriptor.bytes[2 + 2 * i] = static_cast<uint8_t>(text[i]);
  return descriptor;
}
constexpr auto kManufacturer TORQUER_IN_FLASH = MakeStringDescriptor(protocol::kUsbManufacturer);
constexpr auto kProduct TORQUER_IN_FLASH = MakeStringDescriptor(protocol::kUsbProduct);
constexpr uint8_t kLanguages[] TORQUER_IN_FLASH = {4, kStringDescriptorType, 0x09, 0x04};
// clang-format on

static_assert(kVersionMinor < 16 && kVersionPatch < 16, "a nibble each in the device descriptor");

}  // namespace firmware
}  // namespace torquer
