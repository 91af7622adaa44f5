// Serial number of a device. The firmware shows it as its USB serial string. The bootloader is too
// small for that, so the host makes the number from the same bytes.
#pragma once

#include <stdint.h>

#include "protocol/eeprom_layout.h"

namespace torquer {
namespace protocol {

constexpr uint8_t kSerialBytes = sizeof(SerialRecord::serial);
/// Bytes of lot, wafer and position in the chip's signature row, from the factory; all 0xff if it
/// wrote none.
constexpr uint8_t kChipSerialBytes = 10;
constexpr uint8_t kChipSerialAddress = 0x0e;

inline bool IsGivenNumber(const SerialRecord& record) {
  if (record.crc != Crc16(record.serial, kSerialBytes)) return false;
  bool ended = false;
  for (uint8_t i = 0; i < kSerialBytes; ++i) {
    const char c = record.serial[i];
    ended = ended || c == 0;
    if (ended ? c != 0 : (c <= ' ' || c > '~')) return false;
  }
  return record.serial[0] != 0;
}

inline char* AppendHex(uint16_t value, char* out) {
  for (int8_t shift = 12; shift >= 0; shift = static_cast<int8_t>(shift - 4)) {
    const uint8_t digit = (value >> shift) & 0xf;
    *out++ = static_cast<char>(digit < 10 ? '0' + digit : 'A' + digit - 10);
  }
  return out;
}

/// Fills `serial`, zero-padded. A valid number in the EEPROM comes first. Otherwise the number is
/// "TQ-" and eight digits made of the chip's bytes. Without such bytes it is "TQ-00000000".
inline void MakeSerialNumber(const SerialRecord& given, const uint8_t chip[kChipSerialBytes],
                             char serial[kSerialBytes]) {
  if (IsGivenNumber(given)) {
    for (uint8_t i = 0; i < kSerialBytes; ++i) serial[i] = given.serial[i];
    return;
  }
  bool known = false;
  for (uint8_t i = 0; i < kChipSerialBytes; ++i) known = known || chip[i] != 0xff;
  for (uint8_t i = 0; i < kSerialBytes; ++i) serial[i] = 0;
  serial[0] = 'T';
  serial[1] = 'Q';
  serial[2] = '-';
  char* end = AppendHex(known ? Crc16(chip, 5) : 0, serial + 3);
  AppendHex(known ? Crc16(chip + 5, 5) : 0, end);
}

}  // namespace protocol
}  // namespace torquer
