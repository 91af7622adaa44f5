// Registers and bursts of the PMW3360 over the board's SPI, with the required pauses.
#pragma once

#include <stdint.h>

#include "firmware/board/board.h"
#include "firmware/src/pmw3360_registers.h"

namespace torquer {
namespace firmware {

class Pmw3360Bus {
 public:
  /// `sensor` is that of board::SelectSensor().
  explicit Pmw3360Bus(uint8_t sensor) : sensor_(sensor) {}

  uint8_t Read(uint8_t address);
  void Write(uint8_t address, uint8_t value);

  /// A motion burst in two parts; other work may be done between them. The first part latches the
  /// motion. A write to kMotionBurst must arm the burst after any other access.
  void BeginMotion();
  void FinishMotion(uint8_t burst[pmw3360::kBurstBytes]);

  /// Begins a burst of many bytes by sending its first byte: `address`, with kWriteBit for a write.
  void BeginLongBurst(uint8_t address);
  /// Exchanges the next byte, after the pause that the data sheet requires.
  static uint8_t ExchangeInLongBurst(uint8_t byte) {
    return board::TransferSpiAfter(byte, pmw3360::kLongBurstByte);
  }
  /// `pause_us`: minimum time before the next access.
  void EndLongBurst(uint16_t pause_us);

 private:
  void WaitUntilReady();

  void Select(bool selected) const { board::SelectSensor(sensor_, selected); }

  const uint8_t sensor_;
  uint32_t ready_at_us_ = 0;  // earliest next access, from the timing of the last one
};

}  // namespace firmware
}  // namespace torquer
