// Start-up stub that starts an application as Caterina, the bootloader of Arduino's boards, does.
// Caterina has cleared MCUSR by then. A reset by the pin or a timeout of 8 s ends Caterina. The USB
// controller is then on, with an address and with memory for its endpoints. The LED pins are
// outputs. The stub shortens the timeout and serves no request. The order of steps is that of
// Caterina.c and of LUFA, as Arduino publishes them.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/wdt.h>
#include <util/delay.h>

extern "C" {
// Clocks in Hz that this image was built for; the emulator reads them.
extern const uint32_t torquer_cpu_hz __attribute__((__progmem__));
const uint32_t torquer_cpu_hz = F_CPU;
extern const uint32_t torquer_crystal_hz __attribute__((__progmem__));
const uint32_t torquer_crystal_hz = TORQUER_CRYSTAL_HZ;
}

namespace {

constexpr uint16_t kKeyAddress = 0x0800, kKey = 0x7777;
constexpr uint8_t kNotificationEndpoint = 2, kTransmitEndpoint = 3, kReceiveEndpoint = 4;

// About the size of Caterina's own variables: they overwrite RAM that an application keeps over a
// reset.
volatile uint8_t variables[176];

[[noreturn]] void StartSketch() {
  cli();
  TIMSK1 = 0;
  TCCR1B = 0;
  TCNT1 = 0;
  MCUCR = _BV(IVCE);
  MCUCR = 0;
  PORTC &= static_cast<uint8_t>(~_BV(PC7));
  PORTD |= _BV(PD5);
  PORTB |= _BV(PB0);
  asm volatile("jmp 0");
  __builtin_unreachable();
}

void Configure(uint8_t endpoint, uint8_t config0, uint8_t config1) {
  UENUM = endpoint;
  UECONX = _BV(EPEN);
  UECFG0X = config0;
  UECFG1X = config1;
}

void LeaveUsbOn() {
  UHWCON |= _BV(UVREGE);
  USBCON = _BV(USBE) | _BV(FRZCLK);
#if F_CPU == 16000000UL
  PLLCSR = _BV(PINDIV) | _BV(PLLE);
#else
  PLLCSR = _BV(PLLE);
#endif
  while (!(PLLCSR & _BV(PLOCK))) {
  }
  USBCON = _BV(USBE) | _BV(OTGPADE) | _BV(VBUSTE);
  UDCON = 0;
  Configure(0, 0, _BV(ALLOC));  // 8 bytes
  UDIEN = _BV(SUSPE) | _BV(EORSTE);
  UDADDR = 5;
  UDADDR = _BV(ADDEN) | 5;
  Configure(kNotificationEndpoint, _BV(EPTYPE1) | _BV(EPTYPE0) | _BV(EPDIR), _BV(ALLOC));
  Configure(kTransmitEndpoint, _BV(EPTYPE1) | _BV(EPDIR), _BV(EPSIZE0) | _BV(ALLOC));
  Configure(kReceiveEndpoint, _BV(EPTYPE1), _BV(EPSIZE0) | _BV(ALLOC));
}

}  // namespace

int main() {
  volatile uint16_t* const key = reinterpret_cast<volatile uint16_t*>(kKeyAddress);
  const uint16_t found = *key;
  *key = 0;
  const uint8_t reason = MCUSR;
  MCUSR = 0;
  wdt_disable();
  for (volatile uint8_t& variable : variables) variable = 0xa5;
  const bool asked = (reason & _BV(EXTRF)) || ((reason & _BV(WDRF)) && found == kKey);
  if (!asked && (reason & (_BV(PORF) | _BV(WDRF)))) StartSketch();

  CLKPR = _BV(CLKPCE);
  CLKPR = 0;
  DDRB |= _BV(PB0);
  DDRC |= _BV(PC7);
  DDRD |= _BV(PD5);
  OCR1A = 250;
  TCCR1B = _BV(CS11) | _BV(CS10);
  LeaveUsbOn();
  _delay_ms(30);
  UDCON |= _BV(DETACH);
  StartSketch();
}
