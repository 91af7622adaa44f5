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

constexpr uint8_t kControlPacketBytes = 32;  ///< endpoint 0
constexpr uint8_t kInputEndpoint = 1;        ///< interrupt IN, one input report a packet
constexpr uint8_t kInputIntervalMs = 1;

}  // namespace protocol
}  // namespace torquer
