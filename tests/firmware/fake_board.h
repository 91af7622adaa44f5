// Fake board for the portable firmware on the PC: firmware/board/board.h, implemented with plain
// variables that a test sets and reads.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <stdexcept>
#include <vector>

namespace torquer::firmware {

/// Thrown in place of a reset, from which the real board would not return.
struct Restarted : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Thrown by the EEPROM write during which the power fails.
struct PowerLost : std::runtime_error {
  PowerLost() : std::runtime_error("power lost") {}
};

struct FakeBoard {
  // Time advances by one microsecond per read, and while the firmware waits.
  std::uint32_t now_us = 0;
  std::optional<std::uint32_t> frame_start_us;
  int watchdog_kicks = 0;
  bool bus_suspended = false;
  int host_wakes = 0;  ///< number of remote wake-ups

  std::uint8_t reset_reason = 1;
  std::optional<std::uint8_t> warm_byte;
  std::array<std::uint8_t, 10> chip_serial{1, 2, 3, 4, 5, 6, 7, 8, 9, 10};
  bool application_is_whole = true;

  /// Answer to an SPI byte; `first` is true for the first byte after the select.
  std::function<std::uint8_t(std::uint8_t sent, bool first)> sensor;
  bool selected = false;
  bool first_byte = true;
  struct SpiByte {
    std::uint32_t at_us;
    std::uint8_t sent;
    bool first;
  };
  std::vector<SpiByte> spi_log;

  std::array<std::uint16_t, 3> analog{512, 512, 225};  ///< joystick x and y, band gap
  std::size_t input = 0;                               ///< of these, the one being converted
  std::uint8_t buttons = 0;

  std::vector<std::uint8_t> eeprom = std::vector<std::uint8_t>(1024, 0xff);
  int eeprom_writes = 0;
  int eeprom_busy_polls = 0;             ///< EepromReady() is false this many times
  std::optional<int> writes_until_loss;  ///< PowerLost is thrown after this many writes
  /// Progress of the interrupted write: not begun; erasure has set some bits; or programming has
  /// not yet cleared some bits.
  enum class Tear { kNone, kErasing, kProgramming } tear = Tear::kNone;
  std::uint8_t tear_bits = 0;

  bool bus_reset = false;
  std::deque<std::array<std::uint8_t, 8>> setups;
  std::vector<std::vector<std::uint8_t>> control_sent;
  bool can_send_control = true;
  std::deque<std::vector<std::uint8_t>> control_data;
  std::size_t control_byte = 0;  ///< of the packet being read
  int control_holds = 0;         ///< frames in which endpoint 0 was held off
  bool memory_refused = false;   ///< the chip has no memory for the input endpoint
  bool control_stalled = false;
  std::uint8_t address = 0;
  bool input_enabled = false, input_halted = false;
  std::deque<std::vector<std::uint8_t>> inputs;  ///< queued; a test takes them as the host would
};

/// Board of the firmware under test; each test begins with a new one.
FakeBoard& board();
FakeBoard& NewBoard();

}  // namespace torquer::firmware
