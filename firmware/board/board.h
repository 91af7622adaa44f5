// Port contract: the functions that the portable firmware requires of a board. The USB has a
// separate contract, in whole reports: firmware/src/usb_stack.h.
//
// Each chip has an implementation (atmega32u4/), and the unit tests on the PC have a simulated one
// (tests/firmware/fake_board.cpp). The linker chooses. Every function returns within its stated
// time; no function waits for anything outside the chip.
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

/// Sleeps until there is work, at most about 130 ms; returns at once if work is pending. While the
/// bus is suspended, the sleep is deep: only the wake-up sources run. A deep sleep ends with bus
/// activity, or after kSuspendedTickUs, by which NowUs() then advances.
void Idle();
constexpr uint16_t kSuspendedTickUs = 32000;  ///< nominally; the watchdog's oscillator is coarse

/// True if the host has left the bus idle for 3 ms: the device must soon draw almost no current.
/// The last result of this function decides if Idle() sleeps deeply.
bool BusSuspended();

/// Wakes the host on a suspended bus. BusSuspended() then returns false, and true again if the host
/// does not answer within about 0.1 s.
void WakeHost();

/// Call at least every 250 ms, or the chip resets.
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

/// Checks a few bytes of the painted stack; a complete sweep updates the result. Returns the bytes
/// of stack that were never used since the reset.
uint16_t StackHeadroom();

/// Crystal and CPU clock, as protocol::ClockCode().
uint8_t ClockCode();
/// protocol::ImageBoard.
uint8_t Board();

/// Ten bytes of lot, wafer and position that the factory stored in the chip; all 0xff if it stored
/// none.
void ReadChipSerial(uint8_t serial[10]);

uint8_t ReadFlash(const uint8_t* address);

/// True if the application in the flash matched its trailer at the start
/// (protocol/firmware_image.h).
bool ApplicationIsWhole();

// --- sensor bus: SPI mode 3, at most 2 MHz -----------------------------------------------------

/// Chip select of sensor 0, or 1 where the board has two.
void SelectSensor(uint8_t sensor, bool selected);
uint8_t TransferSpi(uint8_t byte);
/// The same, at least `gap_us` (1 .. 100) after the previous byte of this function.
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

/// Present state of the pins, with bounces: protocol::Button bits and kReferenceSwitch, 1 while
/// closed.
uint8_t ReadButtons();
constexpr uint8_t kReferenceSwitch = 1 << 4;

// --- EEPROM ------------------------------------------------------------------------------------

/// False for 3.4 ms after each write.
bool EepromReady();
/// Both wait until the EEPROM is ready. A write continues in the background.
uint8_t ReadEeprom(uint16_t address);
void WriteEeprom(uint16_t address, uint8_t value);

}  // namespace board
}  // namespace torquer
