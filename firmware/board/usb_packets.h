// Packets of a USB controller: what UsbDevice, our own stack, requires of a board that it runs on.
// A board with another stack (usb_stack.h) has none of these functions. None waits for the host.
#pragma once

#include <stdint.h>

namespace torquer {
namespace board {

/// True once for each reset by the host. Address 0, not configured, endpoint 0 is ready.
bool TakeUsbReset();
/// True if a bus reset, a SETUP packet or a packet from the host waits. This is the fastest check.
bool ControlPending();
/// True once for each SETUP packet; discards any other data of endpoint 0.
bool TakeSetup(uint8_t packet[8]);

/// Endpoint 0 can take a packet for the host.
bool CanSendControl();
/// Sends one packet of 0 .. 32 bytes.
void SendControl(const uint8_t* data, uint8_t size, bool in_flash);
/// Endpoint 0 holds a packet from the host, an empty one included.
bool HasControlData();
/// Its size, and its bytes one by one.
uint8_t ControlDataSize();
uint8_t NextControlByte();
/// Its bytes are taken, and the next packet may come; false if a SETUP packet has come meanwhile:
/// what was read means nothing.
bool ReleaseControlData();
/// Refuses the request; the next SETUP packet ends it.
void StallControl();

/// From now on Idle() ends on a SETUP packet and, where asked for, once CanSendControl() or
/// HasControlData() is true.
void WatchControl(bool can_send, bool has_data);
/// From now on Idle() does not end on endpoint 0, until WatchControl() is called again: the host is
/// left to ask again.
void HoldControl();

/// The device answers at this address (0 .. 127) from now on.
void SetAddress(uint8_t address);

/// Sets up or removes the interrupt IN endpoint; its data toggle starts from DATA0 and it is not
/// halted. False if the chip does not give it its memory.
bool ConfigureInput(bool enabled);
void HaltInput(bool halted);
bool InputHalted();
/// Packets queued and not yet taken by the host: 0 .. 2.
uint8_t QueuedInputs();
/// Drops them.
void DiscardInputs();
/// Queues one packet; false if there is no room.
bool QueueInput(const uint8_t* data, uint8_t size);

}  // namespace board
}  // namespace torquer
