// Fuzz target for the firmware with any EEPROM content. Settings must be in range and storable
// again, and the serial number must have printable characters only.
#include <algorithm>
#include <cstring>
#include <stdexcept>

#include "firmware/board/board.h"
#include "firmware/src/serial_number.h"
#include "firmware/src/settings.h"
#include "protocol/eeprom_layout.h"
#include "tests/fuzz/target.h"

namespace torquer {
namespace fuzz::eeprom_target {
namespace {

// The input starts at 0x010: the firmware does not read earlier cells.
Bytes eeprom(protocol::kEepromBytes, 0xff);
constexpr std::size_t kFirst = protocol::kEepromSerialAddress;

}  // namespace
}  // namespace fuzz::eeprom_target

// Board functions that the settings and the serial number use.
namespace board {
bool EepromReady() { return true; }
uint8_t ReadEeprom(uint16_t address) { return fuzz::eeprom_target::eeprom.at(address); }
void WriteEeprom(uint16_t address, uint8_t value) {
  fuzz::eeprom_target::eeprom.at(address) = value;
}
void ReadChipSerial(uint8_t serial[10]) { std::memset(serial, 0x5a, 10); }
}  // namespace board

namespace fuzz::eeprom_target {
namespace {

constexpr std::size_t kSettingsBytes = 10;  // the last two are the CRC of the others

Bytes Filled() { return Bytes(protocol::kEepromBytes, 0xff); }

std::vector<Bytes> Seeds() {
  eeprom = Filled();
  firmware::Settings settings;
  settings.Load();
  settings.Set(3200, 25, 0);
  while (settings.Poll()) {
  }
  protocol::SerialRecord record{{'F', 'U', 'Z', 'Z', '-', '1'}, 0};
  record.crc = protocol::Crc16(record.serial, sizeof record.serial);
  std::memcpy(&eeprom[kFirst], &record, sizeof record);
  const auto first = eeprom.begin() + static_cast<std::ptrdiff_t>(kFirst);
  Bytes once(first, first + 0x70);
  settings.Set(1600, 30, 0);
  while (settings.Poll()) {
  }
  return {once, Bytes(first, first + 0x70)};
}

// True if any copy of the settings was valid.
bool Accepts(std::span<const std::uint8_t> input) {
  eeprom = Filled();
  const std::size_t size = std::min(input.size(), eeprom.size() - kFirst);
  std::copy_n(input.begin(), size, eeprom.begin() + static_cast<std::ptrdiff_t>(kFirst));
  firmware::Settings settings;
  settings.Load();
  const bool good = settings.good() && settings.kept();
  if (settings.cpi() < 100 || settings.cpi() > 12000 || settings.cpi() % 100 != 0 ||
      settings.deadzone() > 511 || settings.closed_at_rest() > 7) {
    throw std::logic_error("settings out of their range");
  }
  char serial[firmware::kSerialBytes];
  firmware::ReadSerialNumber(serial);
  if (serial[0] == 0) throw std::logic_error("no serial number");
  for (const char c : serial) {
    if (c != 0 && (c < ' ' || c > '~')) throw std::logic_error("a serial number not printable");
  }
  settings.Set(2000, 40, 0);
  for (int k = 0; k < 100; ++k) settings.Poll();
  firmware::Settings again;
  again.Load();
  if (again.cpi() != 2000 || again.deadzone() != 40) throw std::logic_error("settings not kept");
  return good;
}

// Corrects the CRCs of the serial number and of both copies of the settings.
void Repair(Bytes& input) {
  const auto put = [&input](std::size_t at, std::size_t size) {
    if (at + size > input.size()) return;
    const std::uint16_t crc =
        protocol::Crc16(&input[at], static_cast<std::uint8_t>(size - sizeof crc));
    std::memcpy(&input[at + size - sizeof crc], &crc, sizeof crc);
  };
  put(0, sizeof(protocol::SerialRecord));
  for (const std::uint16_t address : protocol::kEepromSettingsAddress) {
    put(address - kFirst, kSettingsBytes);
  }
}

const Registration kRegistration({.name = "eeprom",
                                  .seeds = Seeds,
                                  .accepts = Accepts,
                                  .repair = Repair,
                                  .replay_inputs = 60000,
                                  .longest = 1008});

}  // namespace
}  // namespace fuzz::eeprom_target
}  // namespace torquer
