#include "firmware/src/settings.h"

#include <stddef.h>

#include "firmware/board/board.h"
#include "protocol/eeprom_layout.h"
#include "protocol/hid_reports.h"

namespace torquer {
namespace firmware {
namespace {

// A choice between constants: as a variable, the table would lie in the chip's RAM.
constexpr uint16_t AddressOf(uint8_t slot) {
  return slot == 0 ? protocol::kEepromSettingsAddress[0] : protocol::kEepromSettingsAddress[1];
}

constexpr uint8_t kMarker = 0xa1;  // layout 1
constexpr uint8_t kNoMarker = 0xff;
constexpr uint16_t kMinCpi = 100;
constexpr uint16_t kMaxCpi = 12000;
constexpr uint16_t kMaxDeadzone = 511;
constexpr uint8_t kContacts =
    protocol::kButtonXray | protocol::kButtonContrast | protocol::kButtonClutch;

// Record::packed: the deadzone has 9 bits; the contacts follow in the second byte.
constexpr uint8_t kContactsShift = 1;
constexpr uint8_t ContactsIn(uint16_t packed) {
  return static_cast<uint8_t>(static_cast<uint8_t>(packed >> 8) >> kContactsShift);
}

bool InRange(uint16_t cpi, uint16_t deadzone, uint8_t closed_at_rest) {
  return cpi >= kMinCpi && cpi <= kMaxCpi && cpi % 100 == 0 && deadzone <= kMaxDeadzone &&
         (closed_at_rest & ~kContacts) == 0;
}

}  // namespace

bool Settings::ReadCopy(uint8_t slot, Record* record, bool* blank) {
  uint8_t* bytes = reinterpret_cast<uint8_t*>(record);
  constexpr uint8_t kBytes = sizeof(Record);
  for (uint8_t i = 0; i < kBytes; ++i) {
    bytes[i] = board::ReadEeprom(static_cast<uint16_t>(AddressOf(slot) + i));
    *blank = *blank && bytes[i] == 0xff;
  }
  return record->marker == kMarker &&
         record->crc == protocol::Crc16(record, offsetof(Record, crc)) &&
         InRange(record->cpi, record->packed & kMaxDeadzone, ContactsIn(record->packed));
}

void Settings::Load() {
  Record copies[2];
  bool blank = true;
  const bool valid0 = ReadCopy(0, &copies[0], &blank);
  const bool valid1 = ReadCopy(1, &copies[1], &blank);
  stored_ = valid0 || valid1;
  good_ = stored_ || blank;
  if (!stored_) return;
  const bool first_is_newer = static_cast<int8_t>(copies[0].sequence - copies[1].sequence) > 0;
  slot_ = (valid0 && (!valid1 || first_is_newer)) ? 0 : 1;
  record_ = copies[slot_];
  cpi_ = record_.cpi;
  deadzone_ = record_.packed & kMaxDeadzone;
  closed_at_rest_ = ContactsIn(record_.packed);
  writes_ = record_.writes;
}

bool Settings::Set(uint16_t cpi, uint16_t deadzone, uint8_t closed_at_rest) {
  if (!InRange(cpi, deadzone, closed_at_rest)) return false;
  cpi_ = cpi;
  deadzone_ = deadzone;
  closed_at_rest_ = closed_at_rest;
  return true;
}

uint16_t Settings::Packed() const {
  const uint16_t contacts = static_cast<uint16_t>(closed_at_rest_ << kContactsShift);
  return static_cast<uint16_t>(deadzone_ | contacts << 8);
}

bool Settings::kept() const {
  if (step_ != 0) return false;
  return stored_ ? record_.cpi == cpi_ && record_.packed == Packed()
                 : cpi_ == kDefaultCpi && Packed() == kDefaultDeadzone;
}

void Settings::BeginWrite() {
  if (writes_ != UINT16_MAX) ++writes_;
  slot_ ^= 1;
  ++record_.sequence;
  record_.marker = kMarker;
  record_.cpi = cpi_;
  record_.packed = Packed();
  record_.writes = writes_;
  record_.crc = protocol::Crc16(&record_, offsetof(Record, crc));
  step_ = 1;
}

bool Settings::Poll() {
  if (step_ == 0) {
    if (kept()) return false;
    BeginWrite();
  }
  if (!board::EepromReady()) return false;
  // Bytes that already have the new value are not written, which saves time and wear.
  for (; step_ <= sizeof(Record) + 1; ++step_) {
    const uint8_t offset = step_ == sizeof(Record) + 1 ? 0 : static_cast<uint8_t>(step_ - 1);
    const uint8_t wanted =
        step_ == 1 ? kNoMarker : reinterpret_cast<const uint8_t*>(&record_)[offset];
    const uint16_t address = static_cast<uint16_t>(AddressOf(slot_) + offset);
    if (board::ReadEeprom(address) != wanted) {
      board::WriteEeprom(address, wanted);
      ++step_;
      return true;
    }
  }
  step_ = 0;
  stored_ = true;
  good_ = true;
  return true;
}

}  // namespace firmware
}  // namespace torquer
