// Port contract: the functions that the portable firmware requires of a board. Its USB is another
// contract: firmware/src/usb_stack.h, in whole reports.
//
// One implementation a chip (atmega32u4/), and a simulated one for the unit tests on the PC
// (tests/firmware/fake_board.cpp); the linker chooses. Every function returns within the time it
// states; none waits for something outside the chip.
#pragma once

#include <stdint.h>

namespace torquer {
namespace board {

// --- time, sleep, reset ------------------------------------------------------------------------

/// Device clock in microseconds since the start; wraps after 71.6 minutes.
uint32_t NowUs();

/// Waits `us` (1 .. 1000) microseconds, never less.
void DelayUs(uint16_t us);

/// True once for each USB start of frame; `start_us` is when the frame began.
bool TakeFrameStart(uint32_t* start_us);

/// Sleeps until there is something to do, at most about 130 ms; returns at once if there is. While
/// the bus is suspended it sleeps deeply, with everything stopped but what wakes it: until the bus
/// comes to life, and at most kSuspendedTickUs, by which NowUs() then has gone on.
void Idle();
constexpr uint16_t kSuspendedTickUs = 32000;  ///< nominally; the watchdog's oscillator is coarse

/// The host has left the bus idle for 3 ms: the device must soon draw next to nothing. Idle()
/// begins and ends its deep sleep by the answer given here last.
bool BusSuspended();

/// Wakes the host on a suspended bus, which BusSuspended() then is no more; it is again if the host
/// does not answer within about a tenth of a second.
void WakeHost();

/// To be called at least every 250 ms, else the chip resets.
void KickWatchdog();

/// Resets the chip through the watchdog.
[[noreturn]] void Restart();

/// Leaves the USB and resets into the bootloader.
[[noreturn]] void EnterBootloader();

/// Cause of the last reset: protocol::ResetReason bits; 0 if neither chip nor memory shows it.
uint8_t ResetReason();

/// One byte that survives a reset but not a loss of power; `valid` is false after a loss of power.
uint8_t LoadWarmByte(bool* valid);
void StoreWarmByte(uint8_t value);

/// Looks at a few bytes of the painted stack; once a sweep is complete the result is current.
/// Returns the bytes of stack never used since the reset.
uint16_t StackHeadroom();

/// Crystal and CPU clock, as protocol::ClockCode().
uint8_t ClockCode();
/// protocol::ImageBoard.
uint8_t Board();

/// Ten bytes of lot, wafer and position that the factory left in the chip; all 0xff where none.
void ReadChipSerial(uint8_t serial[10]);

uint8_t ReadFlash(const uint8_t* address);

/// True if the application in the flash matched its trailer at the start
/// (protocol/firmware_image.h).
bool ApplicationIsWhole();

// --- sensor bus: SPI mode 3, at most 2 MHz -----------------------------------------------------

void SelectSensor(bool selected);
uint8_t TransferSpi(uint8_t byte);
/// The same, no sooner than `gap_us` (1 .. 100) after the last such byte.
uint8_t TransferSpiAfter(uint8_t byte, uint8_t gap_us);
/// Reads `count` bytes one after the other, and sends zeros meanwhile.
void ReadSpi(uint8_t* bytes, uint8_t count);

// --- joystick, supply and buttons ---------------------------------------------------------------

/// kBandGap is a fixed voltage of kBandGap_mv +-10 %, read against the supply. Its first reading
/// after another input is not settled.
enum class Analog : uint8_t { kJoystickX, kJoystickY, kBandGap };
constexpr uint16_t kBandGap_mv = 1100;

/// Begins a conversion (104 us). The one before must have been fetched.
void BeginAdc(Analog input);
/// The result of the conversion begun last, 0 .. 1023; waits for its end, at most 110 us.
uint16_t FinishAdc();

/// The pins as they are now, as protocol::Button bits and kReferenceSwitch, 1 while closed; bounces
/// included.
uint8_t ReadButtons();
constexpr uint8_t kReferenceSwitch = 1 << 3;

// --- EEPROM ------------------------------------------------------------------------------------

/// False for 3.4 ms after each write.
bool EepromReady();
/// Both wait until the EEPROM is ready. A write continues in the background.
uint8_t ReadEeprom(uint16_t address);
void WriteEeprom(uint16_t address, uint8_t value);

}  // namespace board
}  // namespace torquer
