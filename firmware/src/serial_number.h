// The device's serial number.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

constexpr uint8_t kSerialBytes = 16;

/// Fills `serial`, zero-padded: the number given in EEPROM (protocol::SerialRecord) if it is valid,
/// else "TQ-" and eight digits made of the chip's lot and wafer data, else "TQ-00000000".
void ReadSerialNumber(char serial[kSerialBytes]);

}  // namespace firmware
}  // namespace torquer
