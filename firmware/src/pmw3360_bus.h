// Registers and bursts of the PMW3360 over the board's SPI, with the times that they want.
#pragma once

#include <stdint.h>

#include "firmware/board/board.h"
#include "firmware/src/pmw3360_registers.h"

namespace torquer {
namespace firmware {

class Pmw3360Bus {
 public:
  uint8_t Read(uint8_t address);
  void Write(uint8_t address, uint8_t value);

  /// A motion burst, in two parts, between which something else can be done: what it holds is taken
  /// in the first. To be armed by a write to kMotionBurst since the last other access.
  void BeginMotion();
  void FinishMotion(uint8_t burst[pmw3360::kBurstBytes]);

  /// A burst of many bytes: its first byte goes out (`address` with kWriteBit for a write).
  void BeginLongBurst(uint8_t address);
  /// The next byte, both ways, no sooner than the data sheet wants it.
  static uint8_t ExchangeInLongBurst(uint8_t byte) {
    return board::TransferSpiAfter(byte, pmw3360::kLongBurstByte);
  }
  /// `pause_us` is what the sensor needs before the next access.
  void EndLongBurst(uint16_t pause_us);

 private:
  void WaitUntilReady();

  uint32_t ready_at_us_ = 0;  // earliest next access, from the timing of the last one
};

}  // namespace firmware
}  // namespace torquer
