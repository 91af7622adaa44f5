// Clock, sleep, reset, SPI, ADC, buttons and EEPROM of the ATmega32U4.
#include "firmware/board/board.h"

#include <avr/boot.h>
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <util/delay_basic.h>

#include "firmware/board/atmega32u4/clock.h"
#include "firmware/board/atmega32u4/pins.h"
#include "firmware/board/atmega32u4/setup.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_descriptor.h"  // TORQUER_IN_FLASH
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

// Device time at the last overflow of timer 1. It is a variable with a start value. The emulator
// can change that value in the image, to start just before the wrap-around.
extern "C" {
volatile uint32_t torquer_clock_us __attribute__((section(".data"))) = 0;
// Clocks that this image was built for; the emulator reads them.
extern const uint32_t torquer_cpu_hz TORQUER_IN_FLASH;
const uint32_t torquer_cpu_hz = F_CPU;
extern const uint32_t torquer_crystal_hz TORQUER_IN_FLASH;
const uint32_t torquer_crystal_hz = TORQUER_CRYSTAL_HZ;
// Its circuit; the emulator is wired by it.
extern const uint8_t torquer_image_board TORQUER_IN_FLASH;
const uint8_t torquer_image_board = torquer::board::kImageBoard;
}

namespace torquer {
namespace board {
namespace {

constexpr uint16_t kTicksPerUs = F_CPU / 8 / 1000000;
constexpr uint32_t kUsPerOverflow = 65536 / kTicksPerUs;

// Data kept over a reset; valid only if `mark` is set.
struct WarmRecord {
  uint32_t mark;
  uint8_t byte;
  uint8_t complement;
  uint8_t restart_asked;  // by Restart()
};
static_assert(kWarmRecordAddress + sizeof(WarmRecord) <= protocol::kBootloaderKeyAddress, "below");
static_assert(protocol::kBootloaderKeyAddress + 2 <= kStackLimitAddress,
              "the stack spares the key");
constexpr uint32_t kWarmMark = 0x57524d31;
constexpr uint8_t kAsked = 0x3c;

volatile WarmRecord& Warm() { return *reinterpret_cast<volatile WarmRecord*>(kWarmRecordAddress); }

uint8_t reset_reason;
bool memory_kept;

bool application_is_whole;

bool CheckApplication() {
  protocol::ImageTrailer trailer;
  memcpy_P(&trailer, reinterpret_cast<const void*>(protocol::kImageTrailerAddress),
           sizeof(trailer));
  return protocol::ImageIsWhole(trailer, [](uint16_t address) {
    wdt_reset();
    return static_cast<uint8_t>(pgm_read_byte(address));
  });
}

constexpr uint8_t kStackPaint = 0xc5;
extern "C" uint8_t __stack;  // its first byte

// Saved value of MCUSR. Only a reset clears GPIOR0; a CPU register would not keep the value.
#define TORQUER_SAVED_MCUSR GPIOR0

// Runs before any variable has its value. It stops the watchdog, which still runs after the reset
// that it caused. It paints the stack, so that the depth of the stack can be measured later.
extern "C" void torquer_early_init() __attribute__((naked, used, section(".init3")));
extern "C" void torquer_early_init() {
  TORQUER_SAVED_MCUSR = MCUSR;
  MCUSR = 0;
  wdt_disable();
  uint8_t* const limit = reinterpret_cast<uint8_t*>(kStackLimitAddress);
  for (uint8_t* byte = limit; byte <= &__stack; ++byte) *byte = kStackPaint;
}

// Arduino's bootloader has cleared MCUSR. The cause then follows from the memory, where possible.
void FindResetReason() {
  reset_reason = TORQUER_SAVED_MCUSR;
  const bool marked = Warm().mark == kWarmMark && (Warm().byte ^ Warm().complement) == 0xff;
  const bool asked = marked && Warm().restart_asked == kAsked;
  memory_kept = marked && !(reset_reason & (_BV(PORF) | _BV(BORF)));
  if (reset_reason == 0 && !marked) reset_reason = protocol::kResetPower | protocol::kResetDerived;
  if (reset_reason == 0 && asked) reset_reason = protocol::kResetWatchdog | protocol::kResetDerived;
  Warm().restart_asked = 0;
}

}  // namespace

void SetUp() {
  wdt_enable(WDTO_250MS);
  FindResetReason();

  SetCpuClock();
  // With the factory's fuses the joystick's pins belong to JTAG. The register must be written twice
  // within four cycles.
  MCUCR = _BV(JTD);
  MCUCR = _BV(JTD);

  application_is_whole = CheckApplication();  // before a host can wait for an answer

  // Sensor: not selected; SPI mode 3, 2 MHz.
  TORQUER_SENSOR_NCS_PORT |= _BV(TORQUER_SENSOR_NCS_BIT);
  TORQUER_SENSOR_NCS_DDR |= _BV(TORQUER_SENSOR_NCS_BIT);
  // A pull-up on MISO, so that a missing sensor reads 0xff.
  PORTB |= _BV(PB0) | _BV(PB3) | TORQUER_UNUSED_B;
  DDRB |= _BV(PB0) | _BV(PB1) | _BV(PB2);
#if F_CPU == 16000000UL
  SPSR = _BV(SPI2X);
  SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPOL) | _BV(CPHA) | _BV(SPR0);
#else
  SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPOL) | _BV(CPHA);
#endif

  TORQUER_BUTTON_PORT |= _BV(TORQUER_XRAY_BIT) | _BV(TORQUER_CONTRAST_BIT) |
                         _BV(TORQUER_CLUTCH_BIT) | _BV(TORQUER_STICK_BIT);
  TORQUER_REFERENCE_PORT |= _BV(TORQUER_REFERENCE_BIT);

  // Unused pins and the LEDs: a bootloader may have left them as outputs, so they are set up here.
  DDRB &= static_cast<uint8_t>(~TORQUER_UNUSED_B);
  DDRD &= static_cast<uint8_t>(~TORQUER_UNUSED_D);
  PORTD |= TORQUER_UNUSED_D;
  PORTE |= TORQUER_UNUSED_E;
  PORTF |= TORQUER_UNUSED_F;
  PORTC &= static_cast<uint8_t>(~_BV(PC7));
  DDRC |= _BV(PC7);
  if (kTwoSensors) {
    TORQUER_SENSOR_NCS_PORT |= _BV(TORQUER_SECOND_NCS_BIT);
    TORQUER_SENSOR_NCS_DDR |= _BV(TORQUER_SECOND_NCS_BIT);
  }

  // ADC: 125 kHz, against the supply that feeds the potentiometers.
  DIDR0 = _BV(TORQUER_JOYSTICK_X_CHANNEL) | _BV(TORQUER_JOYSTICK_Y_CHANNEL);
#if F_CPU == 16000000UL
  ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1) | _BV(ADPS0);
#else
  ADCSRA = _BV(ADEN) | _BV(ADPS2) | _BV(ADPS1);
#endif

  TCCR1A = 0;
  TCCR1B = _BV(CS11);  // free-running, F_CPU / 8
  TIMSK1 = _BV(TOIE1);

  SetUpUsb();
  sei();
}

ISR(TIMER1_OVF_vect) {
  torquer_clock_us += kUsPerOverflow;
  if (frameless_overflows != 255) ++frameless_overflows;
}

// Comes while the device is suspended alone, where timer 1 stands still.
ISR(WDT_vect) { torquer_clock_us += kSuspendedTickUs; }

uint32_t NowUs() {
  const uint8_t interrupts = SREG;
  cli();
  uint32_t now_us = torquer_clock_us;
  const uint16_t ticks = TCNT1;
  // The overflow may have come since interrupts were disabled.
  if ((TIFR1 & _BV(TOV1)) && ticks < 0x8000) now_us += kUsPerOverflow;
  SREG = interrupts;
  return now_us + ticks / kTicksPerUs;
}

void DelayUs(uint16_t us) {
  // Four cycles a turn.
  _delay_loop_2(static_cast<uint16_t>(us * (F_CPU / 4000000UL)));
}

namespace {

// With interrupts disabled; an interrupt ends it.
void Sleep() {
  sleep_enable();
  sei();  // takes effect after the next instruction: no interrupt is missed in between
  sleep_cpu();
  sleep_disable();
}

// The same with every clock stopped. The watchdog wakes the chip: its first timeout is an
// interrupt. That interrupt is armed only here, so the next timeout resets the chip if the firmware
// hangs.
void SleepDeeply() {
  ADCSRA &= static_cast<uint8_t>(~_BV(ADEN));
  torquer_clock_us = NowUs();
  TCCR1B = 0;
  TCNT1 = 0;
  TIFR1 = _BV(TOV1);
  wdt_reset();
  WDTCSR = _BV(WDCE) | _BV(WDE);
  WDTCSR = _BV(WDIE) | _BV(WDE) | _BV(WDP0);  // 32 ms
  set_sleep_mode(SLEEP_MODE_PWR_DOWN);
  Sleep();
  wdt_enable(WDTO_250MS);
  TCCR1B = _BV(CS11);
  ADCSRA |= _BV(ADEN);
}

}  // namespace

void Idle() {
  cli();
  while (!EventPending()) {
    if (StopUsbForSuspend()) {
      SleepDeeply();
      break;
    }
    set_sleep_mode(SLEEP_MODE_IDLE);
    Sleep();
    cli();
    // While frames come, an overflow of the timer alone does not end the sleep.
    if (frameless_overflows >= 2) break;
  }
  sei();
}

void KickWatchdog() { wdt_reset(); }

void Restart() {
  cli();
  Warm().restart_asked = kAsked;
  UDCON |= _BV(DETACH);
  wdt_enable(WDTO_15MS);
  for (;;) {
  }
}

void EnterBootloader() {
  cli();
  // The address lies among the variables, which are not needed any more.
  *reinterpret_cast<volatile uint16_t*>(protocol::kBootloaderKeyAddress) = protocol::kBootloaderKey;
  Restart();
}

uint8_t ResetReason() { return reset_reason; }

uint8_t LoadWarmByte(bool* valid) {
  *valid = memory_kept;
  return Warm().byte;
}

void StoreWarmByte(uint8_t value) {
  Warm().byte = value;
  Warm().complement = static_cast<uint8_t>(~value);
  Warm().mark = kWarmMark;
}

uint16_t StackHeadroom() {
  static const uint8_t* next = reinterpret_cast<const uint8_t*>(kStackLimitAddress);
  static uint16_t headroom = 0;
  constexpr uint8_t kBytesAFrame = 4;
  for (uint8_t i = 0; i < kBytesAFrame; ++i) {
    if (*next != kStackPaint) {
      headroom = static_cast<uint16_t>(reinterpret_cast<uint16_t>(next) - kStackLimitAddress);
      next = reinterpret_cast<const uint8_t*>(kStackLimitAddress);
      break;
    }
    ++next;
  }
  return headroom;
}

uint8_t ClockCode() { return kClock; }

uint8_t Board() { return kImageBoard; }

void ReadChipSerial(uint8_t serial[10]) {
  constexpr uint16_t kFirst = 0x0e;  // in the signature row
  const uint8_t interrupts = SREG;
  cli();
  for (uint8_t i = 0; i < 10; ++i) serial[i] = boot_signature_byte_get(kFirst + i);
  SREG = interrupts;
}

uint8_t ReadFlash(const uint8_t* address) { return pgm_read_byte(address); }

bool ApplicationIsWhole() { return application_is_whole; }

namespace {

template <uint8_t kBit>
void Select(bool selected) {
  if (selected) {
    TORQUER_SENSOR_NCS_PORT &= static_cast<uint8_t>(~_BV(kBit));
  } else {
    TORQUER_SENSOR_NCS_PORT |= _BV(kBit);
  }
}

}  // namespace

void SelectSensor(uint8_t sensor, bool selected) {
  if (kTwoSensors && sensor != 0) {
    Select<TORQUER_SECOND_NCS_BIT>(selected);
  } else {
    Select<TORQUER_SENSOR_NCS_BIT>(selected);
  }
}

uint8_t TransferSpi(uint8_t byte) {
  SPDR = byte;
  while (!(SPSR & _BV(SPIF))) {
  }
  return SPDR;
}

uint8_t TransferSpiAfter(uint8_t byte, uint8_t gap_us) {
  // The timer's low byte is enough: a pause longer than its 128 us only adds one more gap.
  static uint8_t end_ticks;
  const uint8_t gap_ticks = static_cast<uint8_t>(gap_us * kTicksPerUs + 1);
  while (static_cast<uint8_t>(TCNT1L - end_ticks) < gap_ticks) {
  }
  const uint8_t received = TransferSpi(byte);
  end_ticks = TCNT1L;
  return received;
}

void ReadSpi(uint8_t* bytes, uint8_t count) {
  SPDR = 0;
  for (; count != 0; --count) {
    while (!(SPSR & _BV(SPIF))) {
    }
    const uint8_t byte = SPDR;
    if (count != 1) SPDR = 0;  // the next one goes while this one is kept
    *bytes++ = byte;
  }
}

void BeginAdc(Analog input) {
  constexpr uint8_t kBandGapChannel = 0x1e;
  uint8_t channel = kBandGapChannel;
  if (input == Analog::kJoystickX) channel = TORQUER_JOYSTICK_X_CHANNEL;
  if (input == Analog::kJoystickY) channel = TORQUER_JOYSTICK_Y_CHANNEL;
  ADMUX = static_cast<uint8_t>(_BV(REFS0) | channel);
  ADCSRA |= _BV(ADSC);
}

uint16_t FinishAdc() {
  while (ADCSRA & _BV(ADSC)) {
  }
  return ADC;
}

uint8_t ReadButtons() {
  const uint8_t pins = TORQUER_BUTTON_PIN;
  return static_cast<uint8_t>(
      (pins & _BV(TORQUER_XRAY_BIT) ? 0 : protocol::kButtonXray) |
      (pins & _BV(TORQUER_CONTRAST_BIT) ? 0 : protocol::kButtonContrast) |
      (pins & _BV(TORQUER_CLUTCH_BIT) ? 0 : protocol::kButtonClutch) |
      (pins & _BV(TORQUER_STICK_BIT) ? 0 : protocol::kButtonStick) |
      (TORQUER_REFERENCE_PIN & _BV(TORQUER_REFERENCE_BIT) ? 0 : kReferenceSwitch));
}

bool EepromReady() { return eeprom_is_ready(); }

uint8_t ReadEeprom(uint16_t address) {
  return eeprom_read_byte(reinterpret_cast<const uint8_t*>(address));
}

void WriteEeprom(uint16_t address, uint8_t value) {
  eeprom_write_byte(reinterpret_cast<uint8_t*>(address), value);
}

}  // namespace board
}  // namespace torquer

// Only a bug of the firmware can call this function. The watchdog then resets the chip.
extern "C" void __cxa_pure_virtual() { torquer::board::Restart(); }
