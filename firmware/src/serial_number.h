// The device's serial number.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

constexpr uint8_t kSerialBytes = 16;

/// Fills `serial`, zero-padded. A valid number in the EEPROM (protocol::SerialRecord) comes first.
/// Otherwise the number is "TQ-" and eight digits made of the chip's lot and wafer data. Without
/// such data it is "TQ-00000000".
void ReadSerialNumber(char serial[kSerialBytes]);

}  // namespace firmware
}  // namespace torquer
