// USB ids of the bench device.
#pragma once

#include <stdint.h>

// USB ids, chosen by the build option TORQUER_USB_IDS (CMakeLists.txt). The default is a pair of
// test ids of pid.codes, for private use. A device with test ids must not be sold or given away
// (https://pid.codes/1209/0001/); hardware/usb_id_application.md applies for ids of the project.
namespace torquer {
namespace protocol {

/// The product string distinguishes the device from others with the same test ids.
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
