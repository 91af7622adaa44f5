#include "firmware/src/serial_number.h"

#include "firmware/board/board.h"
#include "protocol/eeprom_layout.h"

namespace torquer {
namespace firmware {
namespace {

bool ReadGivenNumber(char serial[kSerialBytes]) {
  protocol::SerialRecord record;
  uint8_t* bytes = reinterpret_cast<uint8_t*>(&record);
  constexpr uint8_t kBytes = sizeof(record);
  for (uint8_t i = 0; i < kBytes; ++i) {
    bytes[i] = board::ReadEeprom(static_cast<uint16_t>(protocol::kEepromSerialAddress + i));
  }
  if (record.crc != protocol::Crc16(record.serial, kSerialBytes)) return false;
  bool ended = false;
  for (uint8_t i = 0; i < kSerialBytes; ++i) {
    const char c = record.serial[i];
    ended = ended || c == 0;
    if (ended ? c != 0 : (c <= ' ' || c > '~')) return false;
    serial[i] = c;
  }
  return serial[0] != 0;
}

char* AppendHex(uint16_t value, char* out) {
  for (int8_t shift = 12; shift >= 0; shift -= 4) {
    const uint8_t digit = (value >> shift) & 0xf;
    *out++ = static_cast<char>(digit < 10 ? '0' + digit : 'A' + digit - 10);
  }
  return out;
}

}  // namespace

void ReadSerialNumber(char serial[kSerialBytes]) {
  if (ReadGivenNumber(serial)) return;
  uint8_t chip[10];
  board::ReadChipSerial(chip);
  bool known = false;
  for (const uint8_t byte : chip) known = known || byte != 0xff;
  for (uint8_t i = 0; i < kSerialBytes; ++i) serial[i] = 0;
  serial[0] = 'T';
  serial[1] = 'Q';
  serial[2] = '-';
  char* end = AppendHex(known ? protocol::Crc16(chip, 5) : 0, serial + 3);
  AppendHex(known ? protocol::Crc16(chip + 5, 5) : 0, end);
}

}  // namespace firmware
}  // namespace torquer
