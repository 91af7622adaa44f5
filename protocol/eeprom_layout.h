// EEPROM layout of the bench device (1024 bytes). The firmware uses it, a programmer that writes
// the serial number of a new board, and the emulator.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace torquer {
namespace protocol {

/// Cell 0 is unused: a supply that fails during a write most often damages this cell.
constexpr uint16_t kEepromBytes = 1024;
constexpr uint16_t kEepromSerialAddress = 0x010;                ///< SerialRecord
constexpr uint16_t kEepromSettingsAddress[2] = {0x040, 0x060};  ///< two copies, one live
constexpr uint16_t kEepromPowerOnCountAddress = 0x080;          ///< one byte, source of boot_id

/// CRC-16/CCITT-FALSE (polynomial 0x1021, start 0xffff), a byte at a time.
constexpr uint16_t Crc16Step(uint16_t crc, uint8_t byte) {
  uint8_t x = static_cast<uint8_t>((crc >> 8) ^ byte);
  x = static_cast<uint8_t>(x ^ (x >> 4));
  return static_cast<uint16_t>((crc << 8) ^ (x << 12) ^ (x << 5) ^ x);
}

inline uint16_t Crc16(const void* data, uint8_t size) {
  const uint8_t* bytes = static_cast<const uint8_t*>(data);
  uint16_t crc = 0xffff;
  for (uint8_t i = 0; i < size; ++i) crc = Crc16Step(crc, bytes[i]);
  return crc;
}

/// A serial number given to the board: printable ASCII, zero-padded, at least one character. If the
/// CRC is wrong, the firmware makes a number from the chip's lot and wafer data.
struct __attribute__((packed)) SerialRecord {
  char serial[16];
  uint16_t crc;  ///< Crc16 of `serial`
};
static_assert(sizeof(SerialRecord) == 18, "fits before the settings");

}  // namespace protocol
}  // namespace torquer
