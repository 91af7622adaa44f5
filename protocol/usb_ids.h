// How the bench device names itself on the USB.
#pragma once

#include <stdint.h>

namespace torquer {
namespace protocol {

/// pid.codes test ids, until one of our own is granted; the product string tells devices apart.
constexpr uint16_t kUsbVendorId = 0x1209;
constexpr uint16_t kUsbProductId = 0x0001;
constexpr uint16_t kUsbBootloaderProductId = 0x0002;

constexpr char kUsbManufacturer[] = "Torquer";
constexpr char kUsbProduct[] = "Torquer bench device";
constexpr char kUsbBootloaderProduct[] = "Torquer bootloader";

constexpr uint8_t kControlPacketBytes = 32;  ///< endpoint 0
constexpr uint8_t kInputEndpoint = 1;        ///< interrupt IN, one input report a packet
constexpr uint8_t kInputIntervalMs = 1;

/// The firmware leaves kBootloaderKey at this RAM address and resets by the watchdog: whatever
/// bootloader is there then stays. The convention is that of Caterina.
constexpr uint16_t kBootloaderKeyAddress = 0x0800;
constexpr uint16_t kBootloaderKey = 0x7777;

}  // namespace protocol
}  // namespace torquer
