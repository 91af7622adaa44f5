// The bootloader. At each reset it starts the application or lets the host replace it. README.md
// explains why the bootloader survives an interrupted update.
#include <avr/io.h>
#include <avr/wdt.h>

#include "firmware/board/atmega32u4/clock.h"
#include "firmware/bootloader/application.h"
#include "firmware/bootloader/usb.h"
#include "protocol/usb_ids.h"

extern "C" {
// Clocks and circuit that this image was built for; the emulator reads them.
extern const uint32_t torquer_cpu_hz TORQUER_IN_FLASH;
const uint32_t torquer_cpu_hz = F_CPU;
extern const uint32_t torquer_crystal_hz TORQUER_IN_FLASH;
const uint32_t torquer_crystal_hz = TORQUER_CRYSTAL_HZ;
extern const uint8_t torquer_image_board TORQUER_IN_FLASH;
const uint8_t torquer_image_board = torquer::board::kImageBoard;

// The only vector: the bootloader uses no interrupts. It has no static variables, so the data that
// the application keeps over a reset stay unchanged.
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

// True if the firmware or the reset pin alone requests the bootloader. A slowly rising supply sets
// the flag of the reset pin in addition to the flags of the supply.
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
  torquer::board::SetCpuClock();
  const bool stay = StayWanted();
  torquer::protocol::ImageTrailer trailer;
  ReadTrailer(&trailer);
  const bool valid = Fits(trailer);
  // The application reads MCUSR, and stops the watchdog if it runs.
  if (valid && !stay) StartApplication();
  MCUSR = 0;
  wdt_disable();
  UsbServer server(valid);
  server.Run();
  wdt_enable(WDTO_15MS);
  for (;;) {
  }
}
