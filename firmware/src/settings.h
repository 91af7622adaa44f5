// Settings that survive a loss of power: two copies in EEPROM. An interrupted write damages at most
// one of them.
#pragma once

#include <stdint.h>

namespace torquer {
namespace firmware {

class Settings {
 public:
  static constexpr uint16_t kDefaultCpi = 1200;
  /// Dead zone around the measured rest: the error with which a stick of type KY-023 returns.
  static constexpr uint16_t kDefaultDeadzone = 20;

  /// Reads the newer valid copy; without a valid copy, sets the defaults.
  void Load();

  /// Returns false without a change if a value is out of its range (protocol::ConfigurationReport).
  /// Otherwise the values hold from now on, and Poll() stores those that have changed.
  bool Set(uint16_t cpi, uint16_t deadzone, uint8_t closed_at_rest);

  /// Writes at most one byte to the EEPROM, if it is ready. Call once a frame. True if there was
  /// work.
  bool Poll();

  /// True if no write is in progress and the EEPROM holds the current values; defaults need no
  /// copy.
  bool kept() const;

  uint16_t cpi() const { return cpi_; }
  uint16_t deadzone() const { return deadzone_; }
  /// protocol::Button bits of the contacts that are closed at rest.
  uint8_t closed_at_rest() const { return closed_at_rest_; }
  /// Times the settings were written in this device's life; saturates.
  uint16_t writes() const { return writes_; }
  /// False if the EEPROM held something, but no valid copy.
  bool good() const { return good_; }

 private:
  // Layout in the EEPROM. The marker is cleared first and set last, so a copy with the marker is
  // complete. The CRC reveals a damaged copy.
  struct __attribute__((packed)) Record {
    uint8_t marker;
    uint8_t sequence;  // the copy with the later number is valid
    uint16_t cpi;
    uint16_t packed;  // deadzone; above it closed_at_rest, where earlier firmware wrote 0
    uint16_t writes;
    uint16_t crc;  // of the bytes before
  };

  uint16_t Packed() const;
  static bool ReadCopy(uint8_t slot, Record* record, bool* blank);
  void BeginWrite();

  Record record_ = {};  // stored, or being written
  uint16_t cpi_ = kDefaultCpi;
  uint16_t deadzone_ = kDefaultDeadzone;
  uint16_t writes_ = 0;
  uint8_t closed_at_rest_ = 0;
  uint8_t slot_ = 1;  // of record_
  uint8_t step_ =
      0;  // of a write: 0 none, 1 clear the marker, then the other bytes, then the marker
  bool stored_ = false;
  bool good_ = true;
};

}  // namespace firmware
}  // namespace torquer
