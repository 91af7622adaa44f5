// USB ids of the bench device.
#pragma once

#include <stdint.h>

// The ids, by the build option TORQUER_USB_IDS (CMakeLists.txt). The default ones are test ids of
// pid.codes: for a device on one's own desk. They must not be sold or given away in a device
// (https://pid.codes/1209/0001/); hardware/usb_id_application.md asks for ids of our own.
namespace torquer {
namespace protocol {

/// The product string tells the device from others with the same test ids.
#if defined(TORQUER_USB_VENDOR_ID)
constexpr uint16_t kUsbVendorId = TORQUER_USB_VENDOR_ID;
constexpr uint16_t kUsbProductId = TORQUER_USB_PRODUCT_ID;
constexpr uint16_t kUsbBootloaderProductId = TORQUER_USB_BOOTLOADER_PRODUCT_ID;
#else
constexpr uint16_t kUsbVendorId = 0x1209;
constexpr uint16_t kUsbProductId = 0x0001;
constexpr uint16_t kUsbBootloaderProductId = 0x0002;
#endif

constexpr char kUsbManufacturer[] = "Torquer";
constexpr char kUsbProduct[] = "Torquer bench device";
constexpr char kUsbBootloaderProduct[] = "Torquer bootloader";

constexpr uint8_t kControlPacketBytes = 32;  ///< endpoint 0
constexpr uint8_t kInputEndpoint = 1;        ///< interrupt IN, one input report a packet
constexpr uint8_t kInputIntervalMs = 1;

/// The firmware writes kBootloaderKey to this RAM address and resets by the watchdog. Then the
/// bootloader stays active. This is Caterina's convention.
constexpr uint16_t kBootloaderKeyAddress = 0x0800;
constexpr uint16_t kBootloaderKey = 0x7777;

}  // namespace protocol
}  // namespace torquer
