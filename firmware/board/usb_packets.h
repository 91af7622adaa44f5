// Packets of a USB controller: the functions that UsbDevice, our USB stack, requires of a board. A
// board with another stack (usb_stack.h) does not need them. No function waits for the host.
#pragma once

#include <stdint.h>

namespace torquer {
namespace board {

/// True once for each reset by the host. The device then has address 0, is not configured, and
/// endpoint 0 is ready.
bool TakeUsbReset();
/// True if a bus reset, a SETUP packet or a packet from the host waits. This is the fastest check.
bool ControlPending();
/// True once for each SETUP packet; discards any other data of endpoint 0.
bool TakeSetup(uint8_t packet[8]);

/// True if endpoint 0 can take a packet for the host.
bool CanSendControl();
/// Sends one packet of 0 .. 32 bytes.
void SendControl(const uint8_t* data, uint8_t size, bool in_flash);
/// True if endpoint 0 holds a packet from the host, which may be empty.
bool HasControlData();
/// Size of the packet from the host, and its bytes one by one.
uint8_t ControlDataSize();
uint8_t NextControlByte();
/// Releases the packet that was read, so that the next one may come. False if a SETUP packet has
/// arrived since; discard the bytes that were read.
bool ReleaseControlData();
/// Refuses the request (stall); the next SETUP packet ends the stall.
void StallControl();

/// From now on a SETUP packet ends Idle(). If selected, CanSendControl() or HasControlData() also
/// ends it.
void WatchControl(bool can_send, bool has_data);
/// From now on endpoint 0 does not end Idle(), until WatchControl() is called again. The host then
/// repeats its request.
void HoldControl();

/// The device answers at this address (0 .. 127) from now on.
void SetAddress(uint8_t address);

/// Sets up or removes the interrupt IN endpoint; its data toggle starts from DATA0 and it is not
/// halted. False if the chip has no memory for it.
bool ConfigureInput(bool enabled);
void HaltInput(bool halted);
bool InputHalted();
/// Queued packets that the host has not taken yet: 0 .. 2.
uint8_t QueuedInputs();
/// Drops them.
void DiscardInputs();
/// Queues one packet; false if there is no room.
bool QueueInput(const uint8_t* data, uint8_t size);

}  // namespace board
}  // namespace torquer
