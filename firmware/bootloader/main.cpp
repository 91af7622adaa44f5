// The bootloader: decides at each reset whether the application is started, and if not, lets the
// host replace it. README.md says why it cannot be got rid of by a cut cable.
#include <avr/io.h>
#include <avr/wdt.h>

#include "firmware/bootloader/application.h"
#include "firmware/bootloader/usb.h"
#include "protocol/usb_ids.h"

#if F_CPU != 16000000UL && F_CPU != 8000000UL
#error "the USB needs a crystal of 8 or 16 MHz"
#endif

extern "C" {
// Clock that this image was built for; the emulator reads it.
extern const uint32_t torquer_clock_hz TORQUER_IN_FLASH;
const uint32_t torquer_clock_hz = F_CPU;

// The only vector: the bootloader uses no interrupts. It has no static variables, so it leaves
// those that the application keeps over a reset unchanged.
void torquer_reset_vector() __attribute__((naked, used, section(".vectors")));
void torquer_reset_vector() { asm volatile("rjmp torquer_start"); }
void torquer_start() __attribute__((naked, used, section(".init0")));
void torquer_start() {
  asm volatile("clr __zero_reg__");
  SP = RAMEND;
}
int main() __attribute__((OS_main, used, externally_visible));
void torquer_call_main() __attribute__((naked, used, section(".init9")));
void torquer_call_main() { asm volatile("rjmp main"); }
}

namespace torquer {
namespace bootloader {
namespace {

// True if the firmware or the reset pin alone requests the bootloader. A slow supply sets the reset
// pin's flag beside its own.
bool StayWanted() {
  volatile uint16_t* const key =
      reinterpret_cast<volatile uint16_t*>(protocol::kBootloaderKeyAddress);
  const uint8_t reason = MCUSR & (_BV(PORF) | _BV(EXTRF) | _BV(BORF) | _BV(WDRF));
  const bool asked = (reason & _BV(WDRF)) && *key == protocol::kBootloaderKey;
  *key = 0;
  return asked || reason == _BV(EXTRF);
}

[[noreturn]] void StartApplication() {
  asm volatile("jmp 0");
  __builtin_unreachable();
}

}  // namespace
}  // namespace bootloader
}  // namespace torquer

int main() {
  using namespace torquer::bootloader;
  const bool stay = StayWanted();
  torquer::protocol::ImageTrailer trailer;
  ReadTrailer(&trailer);
  const bool valid = Fits(trailer);
  // The application reads MCUSR, and stops the watchdog if it runs.
  if (valid && !stay) StartApplication();
  MCUSR = 0;
  wdt_disable();
  // With the factory's fuses the clock is divided by 8. The change takes two writes in four cycles.
  CLKPR = _BV(CLKPCE);
  CLKPR = 0;
  UsbServer server(valid);
  server.Run();
  wdt_enable(WDTO_15MS);
  for (;;) {
  }
}
