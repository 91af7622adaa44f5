// The USB device controller of the ATmega32U4. The interrupts only record events; the main loop
// serves endpoint 0.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>

#include "firmware/board/atmega32u4/clock.h"
#include "firmware/board/atmega32u4/setup.h"
#include "firmware/board/board.h"
#include "firmware/board/usb_packets.h"
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

namespace torquer {
namespace board {
namespace {

constexpr uint8_t kControlEndpoint = 0;
constexpr uint8_t kPacket32 = _BV(EPSIZE1);  // endpoint size code
// Writing 1 to this bit of UEINTX drops a packet; on an OUT or control endpoint it is RXOUTI. A 1
// changes no other bit of the register.
constexpr uint8_t kKillBank = _BV(RXOUTI);
static_assert(protocol::kControlPacketBytes == 32 && sizeof(protocol::InputReport) == 32,
              "kPacket32");

volatile bool frame_started;
volatile uint32_t frame_start_us;
volatile bool bus_was_reset;
volatile bool control_event;
uint8_t last_control_byte;  // taken from a data packet

// The bus counts as suspended when the chip reports 3 ms of idle time. A spurious wake-up has no
// start-of-frame after it, and the chip reports no second idle time. Then the bus counts as
// suspended after a time without frames that is longer than a host's reset.
volatile bool bus_idle;
bool suspension_reported;  // last result of BusSuspended()
#if F_CPU == 16000000UL
constexpr uint8_t kFramelessOverflows = 4;  // 98 .. 131 ms
#else
constexpr uint8_t kFramelessOverflows = 3;  // 131 .. 197 ms
#endif

constexpr uint8_t kAwakeInterrupts = _BV(EORSTE) | _BV(SOFE);

void SelectEndpoint(uint8_t endpoint) { UENUM = endpoint; }

bool BusIsIdle() { return bus_idle || frameless_overflows >= kFramelessOverflows; }

void NoteBusAlive() {
  bus_idle = false;
  frameless_overflows = 0;
}

// Starts the USB clock, which the PLL derives from the crystal.
void RunUsbClock() {
  StartPll();
  USBCON = _BV(USBE) | _BV(OTGPADE);
}

// The clock runs again after StopUsbForSuspend(). The suspend interrupt stays masked until the next
// frame. Its flag stays set, because the chip can wake the host only while it is set.
void LeaveSuspend() {
  RunUsbClock();
  NoteBusAlive();
  UDIEN = kAwakeInterrupts;
}

}  // namespace

volatile uint8_t frameless_overflows;

// A bootloader may have left the controller on, with endpoints that hold its memory. Switching the
// controller off releases the memory.
void SetUpUsb() {
  USBCON = 0;
  PLLCSR = 0;
  USBINT = 0;
  UHWCON = _BV(UVREGE);
  USBCON = _BV(USBE) | _BV(FRZCLK);
  RunUsbClock();
  UDCON = 0;  // full speed, attached
  UDIEN = kAwakeInterrupts | _BV(SUSPE);
}

bool BusSuspended() {
  suspension_reported = BusIsIdle();
  return suspension_reported;
}

bool StopUsbForSuspend() {
  if (!suspension_reported || !BusIsIdle()) return false;
  if (USBCON & _BV(FRZCLK)) return true;
  // An old wake-up flag would end the sleep at once; an active bus sets it again.
  UDINT = static_cast<uint8_t>(~_BV(WAKEUPI));
  UDIEN = _BV(EORSTE) | _BV(WAKEUPE);
  USBCON = _BV(USBE) | _BV(OTGPADE) | _BV(FRZCLK);
  PLLCSR = 0;
  return true;
}

void WakeHost() {
  const uint8_t interrupts = SREG;
  cli();
  if (USBCON & _BV(FRZCLK)) {
    LeaveSuspend();
    UDCON = _BV(RMWKUP);
  }
  SREG = interrupts;
}

ISR(USB_GEN_vect) {
  // With the clock stopped this is WAKEUPI, and no flag could be cleared.
  if (USBCON & _BV(FRZCLK)) LeaveSuspend();
  const uint8_t flags = UDINT;
  UDINT = static_cast<uint8_t>(~(flags & ~_BV(SUSPI)));
  if ((flags & _BV(SUSPI)) && (UDIEN & _BV(SUSPE))) {
    UDIEN = kAwakeInterrupts;
    bus_idle = true;
  }
  if (flags & _BV(EORSTI)) {
    NoteBusAlive();
    const uint8_t endpoint = UENUM;
    UENUM = kControlEndpoint;
    UECONX = _BV(EPEN);
    UECFG0X = 0;
    UECFG1X = kPacket32 | _BV(ALLOC);
    if (!(UESTA0X & _BV(CFGOK))) Restart();
    UEIENX = _BV(RXSTPE);
    UENUM = endpoint;
    bus_was_reset = true;
  }
  if (flags & _BV(SOFI)) {
    frame_start_us = NowUs();
    frame_started = true;
    NoteBusAlive();
    if (!(UDIEN & _BV(SUSPE))) {
      UDINT = static_cast<uint8_t>(~_BV(SUSPI));
      UDIEN = kAwakeInterrupts | _BV(SUSPE);
    }
  }
}

// The flags stay up until the main loop has dealt with them, so the interrupt must be masked.
ISR(USB_COM_vect) {
  const uint8_t endpoint = UENUM;
  UENUM = kControlEndpoint;
  UEIENX = 0;
  UENUM = endpoint;
  control_event = true;
}

void WatchControl(bool can_send, bool has_data) {
  SelectEndpoint(kControlEndpoint);
  control_event = false;
  UEIENX = static_cast<uint8_t>(_BV(RXSTPE) | (can_send ? _BV(TXINE) : 0) |
                                (has_data ? _BV(RXOUTE) : 0));
}

void HoldControl() {
  SelectEndpoint(kControlEndpoint);
  UEIENX = 0;
  control_event = false;
}

bool EventPending() {
  return frame_started || bus_was_reset || control_event || BusIsIdle() != suspension_reported;
}

bool TakeFrameStart(uint32_t* start_us) {
  const uint8_t interrupts = SREG;
  cli();
  const bool started = frame_started;
  frame_started = false;
  *start_us = frame_start_us;
  SREG = interrupts;
  return started;
}

// The flag is cleared only if it was read as set. An unconditional write could lose a reset that
// comes between read and write. A reset after the read is handled together with the earlier one.
__attribute__((noinline)) bool TakeUsbReset() {
  if (!bus_was_reset) return false;
  bus_was_reset = false;
  return true;
}

bool ControlPending() {
  SelectEndpoint(kControlEndpoint);
  return bus_was_reset || (UEINTX & (_BV(RXOUTI) | _BV(RXSTPI))) != 0;
}

// Another SETUP packet may replace this one at any moment. Then there are bytes again, and the last
// eight are those of the new packet. Only the cycles between the last check and the clearing remain
// unprotected.
bool TakeSetup(uint8_t packet[8]) {
  SelectEndpoint(kControlEndpoint);
  if (!(UEINTX & _BV(RXSTPI))) return false;
  uint8_t ring[8];
  uint8_t taken = 0;
  // The packet came between the last check and the last read of a data packet, which took its first
  // byte.
  if (UEBCLX == 7) ring[taken++] = last_control_byte;
  while (UEBCLX != 0) ring[taken++ & 7] = UEDATX;
  // A packet that was read before the SETUP packet is obsolete.
  UEINTX = static_cast<uint8_t>(~(_BV(RXSTPI) | _BV(RXOUTI)));
  for (uint8_t i = 0; i < 8; ++i) packet[i] = ring[(taken + i) & 7];
  return true;
}

bool CanSendControl() {
  SelectEndpoint(kControlEndpoint);
  return UEINTX & _BV(TXINI);
}

// Does not send if a new SETUP packet has arrived, because the data are for the previous request.
void SendControl(const uint8_t* data, uint8_t size, bool in_flash) {
  SelectEndpoint(kControlEndpoint);
  if (UEINTX & _BV(RXSTPI)) return;
  for (; size != 0; --size, ++data) UEDATX = in_flash ? pgm_read_byte(data) : *data;
  if (UEINTX & _BV(RXSTPI)) return;
  UEINTX = static_cast<uint8_t>(~_BV(TXINI));
}

bool HasControlData() {
  SelectEndpoint(kControlEndpoint);
  return (UEINTX & (_BV(RXOUTI) | _BV(RXSTPI))) == _BV(RXOUTI);
}

uint8_t ControlDataSize() {
  SelectEndpoint(kControlEndpoint);
  return UEBCLX;
}

// A SETUP packet may have arrived since; its bytes stay in the endpoint.
uint8_t NextControlByte() {
  if (!(UEINTX & _BV(RXSTPI))) last_control_byte = UEDATX;
  return last_control_byte;
}

bool ReleaseControlData() {
  SelectEndpoint(kControlEndpoint);
  // Keeps the bank if a SETUP packet has arrived since.
  if (UEINTX & _BV(RXSTPI)) return false;
  UEINTX = static_cast<uint8_t>(~_BV(RXOUTI));
  return true;
}

void StallControl() {
  SelectEndpoint(kControlEndpoint);
  if (UEINTX & _BV(RXSTPI)) return;
  UECONX = _BV(STALLRQ) | _BV(EPEN);
}

void SetAddress(uint8_t address) {
  UDADDR = address;  // stored first, enabled by another write
  UDADDR = static_cast<uint8_t>(_BV(ADDEN) | address);
}

bool ConfigureInput(bool enabled) {
  SelectEndpoint(protocol::kInputEndpoint);
  if (enabled) {
    UECONX = _BV(EPEN);
    UECFG0X = _BV(EPTYPE1) | _BV(EPTYPE0) | _BV(EPDIR);  // interrupt, IN
    UECFG1X = kPacket32 | _BV(EPBK0) | _BV(ALLOC);       // two banks
    if (!(UESTA0X & _BV(CFGOK))) return false;
    UECONX = _BV(STALLRQC) | _BV(RSTDT) | _BV(EPEN);
  } else {
    UECFG1X = 0;
    UECONX = 0;
  }
  UERST = _BV(protocol::kInputEndpoint);
  UERST = 0;
  return true;
}

void HaltInput(bool halted) {
  SelectEndpoint(protocol::kInputEndpoint);
  if (halted) {
    UECONX = _BV(STALLRQ) | _BV(EPEN);
  } else {
    UECONX = _BV(STALLRQC) | _BV(RSTDT) | _BV(EPEN);
  }
}

bool InputHalted() {
  SelectEndpoint(protocol::kInputEndpoint);
  return UECONX & _BV(STALLRQ);
}

uint8_t QueuedInputs() {
  SelectEndpoint(protocol::kInputEndpoint);
  return UESTA0X & (_BV(NBUSYBK1) | _BV(NBUSYBK0));
}

// The abort sequence of the data sheet: kill the bank written last until no bank is busy. The bit
// is set while the chip waits for that bank's transfer to end, at most for one packet.
void DiscardInputs() {
  SelectEndpoint(protocol::kInputEndpoint);
  for (uint8_t bank = 0; bank < 2 && QueuedInputs() != 0; ++bank) {
    UEINTX = 0xff;
    for (uint8_t turn = 0; turn < 255 && (UEINTX & kKillBank); ++turn) {
    }
  }
}

bool QueueInput(const uint8_t* data, uint8_t size) {
  SelectEndpoint(protocol::kInputEndpoint);
  if (!(UEINTX & _BV(TXINI))) return false;
  UEINTX = static_cast<uint8_t>(~(_BV(TXINI) | kKillBank));
  for (; size >= 4; size = static_cast<uint8_t>(size - 4)) {  // four at a turn: twice as fast
    UEDATX = *data++;
    UEDATX = *data++;
    UEDATX = *data++;
    UEDATX = *data++;
  }
  for (; size != 0; --size) UEDATX = *data++;
  UEINTX = static_cast<uint8_t>(~(_BV(FIFOCON) | kKillBank));
  return true;
}

}  // namespace board
}  // namespace torquer
