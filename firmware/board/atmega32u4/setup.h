// What the parts of this board call of each other.
#pragma once

namespace torquer {
namespace board {

/// Everything the board contract needs, the watchdog and the USB included; interrupts on.
void SetUp();

/// Pads, clock and interrupts of the USB; attaches to the host.
void SetUpUsb();

/// An interrupt has left something to do. To be called with interrupts disabled.
bool EventPending();

}  // namespace board
}  // namespace torquer
