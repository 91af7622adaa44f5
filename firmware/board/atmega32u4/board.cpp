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

#include "firmware/board/atmega32u4/pins.h"
#include "firmware/board/atmega32u4/setup.h"
#include "protocol/firmware_image.h"
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"

#if F_CPU != 16000000UL && F_CPU != 8000000UL
#error "the USB needs a crystal of 8 or 16 MHz"
#endif

// Device time at the last overflow of timer 1. It lies among the variables with a start value, so
// that the emulator can change that value in the image and start just before the wrap-around.
extern "C" {
volatile uint32_t torquer_clock_us __attribute__((section(".data"))) = 0;
// The clock that this image was built for, for whoever runs or flashes it.
extern const uint32_t torquer_clock_hz TORQUER_IN_FLASH;
const uint32_t torquer_clock_hz = F_CPU;
}

namespace torquer {
namespace board {
namespace {

constexpr uint16_t kTicksPerUs = F_CPU / 8 / 1000000;
constexpr uint32_t kUsPerOverflow = 65536 / kTicksPerUs;

uint8_t reset_reason __attribute__((section(".noinit")));
uint8_t warm_byte __attribute__((section(".noinit")));
uint8_t warm_complement __attribute__((section(".noinit")));

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
extern "C" uint8_t _end;     // of the variables; the stack grows down towards it
extern "C" uint8_t __stack;  // its first byte

// Before any variable has its value: the watchdog still runs from the reset that it caused, and the
// stack is painted so that its depth can be told later.
extern "C" void torquer_early_init() __attribute__((naked, used, section(".init3")));
extern "C" void torquer_early_init() {
  reset_reason = MCUSR;
  MCUSR = 0;
  wdt_disable();
  for (uint8_t* byte = &_end; byte <= &__stack; ++byte) *byte = kStackPaint;
}

}  // namespace

void SetUp() {
  wdt_enable(WDTO_250MS);

  // As the factory's fuses leave them, the clock is divided by 8 and the joystick's pins are
  // JTAG's. Both registers want to be written twice within four cycles.
  CLKPR = _BV(CLKPCE);
  CLKPR = 0;
  MCUCR = _BV(JTD);
  MCUCR = _BV(JTD);

  application_is_whole = CheckApplication();  // before a host can wait for an answer

  // Sensor: not selected; SPI mode 3, 2 MHz.
  TORQUER_SENSOR_NCS_PORT |= _BV(TORQUER_SENSOR_NCS_BIT);
  TORQUER_SENSOR_NCS_DDR |= _BV(TORQUER_SENSOR_NCS_BIT);
  PORTB |= _BV(PB3);  // a pull-up on MISO, so that a missing sensor reads 0xff
  DDRB |= _BV(PB0) | _BV(PB1) | _BV(PB2);
#if F_CPU == 16000000UL
  SPSR = _BV(SPI2X);
  SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPOL) | _BV(CPHA) | _BV(SPR0);
#else
  SPCR = _BV(SPE) | _BV(MSTR) | _BV(CPOL) | _BV(CPHA);
#endif

  TORQUER_BUTTON_PORT |=
      _BV(TORQUER_XRAY_BIT) | _BV(TORQUER_CONTRAST_BIT) | _BV(TORQUER_CLUTCH_BIT);

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

// The same with every clock stopped. The watchdog ticks: its first timeout is the interrupt, and
// since that is armed here alone, the next one is a reset, should the firmware not come back.
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
  if (!EventPending()) {
    if (StopUsbForSuspend()) {
      SleepDeeply();
    } else {
      set_sleep_mode(SLEEP_MODE_IDLE);
      Sleep();
    }
  }
  sei();
}

void KickWatchdog() { wdt_reset(); }

void Restart() {
  cli();
  UDCON |= _BV(DETACH);
  wdt_enable(WDTO_15MS);
  for (;;) {
  }
}

void EnterBootloader() {
  cli();
  // The address lies in the variables, which are of no more use.
  *reinterpret_cast<volatile uint16_t*>(protocol::kBootloaderKeyAddress) = protocol::kBootloaderKey;
  Restart();
}

uint8_t ResetReason() { return reset_reason; }

uint8_t LoadWarmByte(bool* valid) {
  const bool lost_power = reset_reason & (_BV(PORF) | _BV(BORF));
  *valid = !lost_power && warm_byte == static_cast<uint8_t>(~warm_complement);
  return warm_byte;
}

void StoreWarmByte(uint8_t value) {
  warm_byte = value;
  warm_complement = static_cast<uint8_t>(~value);
}

uint16_t StackHeadroom() {
  static const uint8_t* next = &_end;
  static uint16_t headroom = 0;
  constexpr uint8_t kBytesAFrame = 16;
  for (uint8_t i = 0; i < kBytesAFrame; ++i) {
    if (*next != kStackPaint) {
      headroom = static_cast<uint16_t>(next - &_end);
      next = &_end;
      break;
    }
    ++next;
  }
  return headroom;
}

uint8_t ClockMhz() { return F_CPU / 1000000; }

void ReadChipSerial(uint8_t serial[10]) {
  constexpr uint16_t kFirst = 0x0e;  // in the signature row
  const uint8_t interrupts = SREG;
  cli();
  for (uint8_t i = 0; i < 10; ++i) serial[i] = boot_signature_byte_get(kFirst + i);
  SREG = interrupts;
}

uint8_t ReadFlash(const uint8_t* address) { return pgm_read_byte(address); }

bool ApplicationIsWhole() { return application_is_whole; }

void SelectSensor(bool selected) {
  if (selected) {
    TORQUER_SENSOR_NCS_PORT &= static_cast<uint8_t>(~_BV(TORQUER_SENSOR_NCS_BIT));
  } else {
    TORQUER_SENSOR_NCS_PORT |= _BV(TORQUER_SENSOR_NCS_BIT);
  }
}

uint8_t TransferSpi(uint8_t byte) {
  SPDR = byte;
  while (!(SPSR & _BV(SPIF))) {
  }
  return SPDR;
}

void BeginAdc(Axis axis) {
  const uint8_t channel =
      axis == Axis::kX ? TORQUER_JOYSTICK_X_CHANNEL : TORQUER_JOYSTICK_Y_CHANNEL;
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
  return static_cast<uint8_t>((pins & _BV(TORQUER_XRAY_BIT) ? 0 : protocol::kButtonXray) |
                              (pins & _BV(TORQUER_CONTRAST_BIT) ? 0 : protocol::kButtonContrast) |
                              (pins & _BV(TORQUER_CLUTCH_BIT) ? 0 : protocol::kButtonClutch));
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

// A call that no object answers is a bug of ours: let the watchdog tell.
extern "C" void __cxa_pure_virtual() { torquer::board::Restart(); }
