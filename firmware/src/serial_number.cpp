#include "firmware/src/serial_number.h"

#include "firmware/board/board.h"
#include "protocol/serial_number.h"

namespace torquer {
namespace firmware {

static_assert(kSerialBytes == protocol::kSerialBytes, "one number");

void ReadSerialNumber(char serial[kSerialBytes]) {
  protocol::SerialRecord given;
  uint8_t* bytes = reinterpret_cast<uint8_t*>(&given);
  constexpr uint8_t kBytes = sizeof(given);
  for (uint8_t i = 0; i < kBytes; ++i) {
    bytes[i] = board::ReadEeprom(static_cast<uint16_t>(protocol::kEepromSerialAddress + i));
  }
  uint8_t chip[protocol::kChipSerialBytes];
  board::ReadChipSerial(chip);
  protocol::MakeSerialNumber(given, chip, serial);
}

}  // namespace firmware
}  // namespace torquer
