// Functions and addresses that the source files of this board share.
#pragma once

#include <stdint.h>

namespace torquer {
namespace board {

/// Address of the data kept over a reset. It lies below the key for the bootloader and below the
/// stack. It lies above the variables, which Arduino's bootloader overwrites.
constexpr uint16_t kWarmRecordAddress = 0x07f0;
/// The stack may grow down to here.
constexpr uint16_t kStackLimitAddress = 0x0802;

/// Sets up the whole board, the watchdog and the USB included, and enables interrupts.
void SetUp();

/// Sets up pads, clock and interrupts of the USB, and attaches to the host.
void SetUpUsb();

/// True if an interrupt has left work. Call with interrupts disabled.
bool EventPending();

/// Stops the USB's clock if BusSuspended() returned true and the bus is still idle; false if not.
/// Bus activity starts the clock again. Call with interrupts disabled.
bool StopUsbForSuspend();

/// Overflows of timer 1 since the last activity on the bus; stops at 255.
extern volatile uint8_t frameless_overflows;

}  // namespace board
}  // namespace torquer
