#include "firmware/src/boot_id.h"

#include "firmware/board/board.h"
#include "protocol/eeprom_layout.h"

namespace torquer {
namespace firmware {

uint8_t NextBootId() {
  constexpr uint8_t kResetBits = 0x07;
  bool survived = false;
  uint8_t id = board::LoadWarmByte(&survived);
  if (survived) {
    id = static_cast<uint8_t>((id & ~kResetBits) | ((id + 1) & kResetBits));
  } else {
    const uint8_t power_ons =
        static_cast<uint8_t>(board::ReadEeprom(protocol::kEepromPowerOnCountAddress) + 1);
    board::WriteEeprom(protocol::kEepromPowerOnCountAddress, power_ons);
    id = static_cast<uint8_t>(power_ons << 3);
  }
  board::StoreWarmByte(id);
  return id;
}

}  // namespace firmware
}  // namespace torquer
