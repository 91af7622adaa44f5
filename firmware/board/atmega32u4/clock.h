// Crystal, CPU clock and circuit of an image: F_CPU, TORQUER_CRYSTAL_HZ and TORQUER_BOARD come from
// the build.
#pragma once

#include <avr/io.h>
#include <stdint.h>

#include "protocol/firmware_image.h"

#if TORQUER_CRYSTAL_HZ != 16000000UL && TORQUER_CRYSTAL_HZ != 8000000UL
#error "the USB needs a crystal of 8 or 16 MHz"
#endif
#if F_CPU != TORQUER_CRYSTAL_HZ && F_CPU != TORQUER_CRYSTAL_HZ / 2
#error "the CPU runs at the crystal's clock, or at half of it"
#endif
#if F_CPU != 16000000UL && F_CPU != 8000000UL
#error "the times of the firmware need a CPU of 8 or 16 MHz"
#endif

namespace torquer {
namespace board {

constexpr uint8_t kImageBoard = TORQUER_BOARD;
static_assert(protocol::IsKnownBoard(kImageBoard), "a number of protocol::ImageBoard");
constexpr bool kTwoSensors = kImageBoard == protocol::kBoardTwoSensorsAtmega32u4;

constexpr uint8_t kClock =
    protocol::ClockCode(TORQUER_CRYSTAL_HZ / 1000000, static_cast<uint8_t>(F_CPU / 1000000));

/// Sets the CPU's clock. After a reset, the factory's fuses divide it by 8. The register must be
/// written twice within four cycles.
inline void SetCpuClock() {
  CLKPR = _BV(CLKPCE);
  CLKPR = kClock & protocol::kHalfClock ? _BV(CLKPS0) : 0;
}

/// Starts the PLL from the crystal and waits until it has locked, at most 100 us. The CPU's divider
/// does not affect the PLL.
inline void StartPll() {
  PLLCSR = TORQUER_CRYSTAL_HZ == 16000000UL ? _BV(PINDIV) | _BV(PLLE) : _BV(PLLE);
  while (!(PLLCSR & _BV(PLOCK))) {
  }
}

}  // namespace board
}  // namespace torquer
