#include "firmware/bootloader/application.h"

#include <avr/boot.h>
#include <avr/pgmspace.h>
#include <avr/wdt.h>
#include <string.h>

#include "firmware/board/atmega32u4/clock.h"

namespace torquer {
namespace bootloader {
namespace {

uint8_t ReadKicking(uint16_t address) {
  wdt_reset();
  return pgm_read_byte(address);
}

void Erase(uint16_t page) {
  boot_page_erase(page);
  boot_spm_busy_wait();
}

}  // namespace

void ReadTrailer(protocol::ImageTrailer* trailer) {
  memcpy_P(trailer, reinterpret_cast<const void*>(protocol::kImageTrailerAddress),
           sizeof(*trailer));
}

bool Fits(const protocol::ImageTrailer& trailer) {
  return trailer.board == board::kImageBoard && trailer.clock == board::kClock &&
         protocol::ImageIsWhole(trailer, ReadKicking);
}

bool WritePage(uint16_t address, const uint8_t data[protocol::kFlashPageBytes],
               bool* trailer_erased) {
  if (address == protocol::kImageTrailerAddress) {
    if (!Fits(*reinterpret_cast<const protocol::ImageTrailer*>(data))) return false;
    *trailer_erased = false;
  } else {
    if (address > protocol::kImageTrailerAddress || address % protocol::kFlashPageBytes != 0) {
      return false;
    }
    if (!*trailer_erased) Erase(protocol::kImageTrailerAddress);
    *trailer_erased = true;
  }
  Erase(address);
  for (uint8_t i = 0; i < protocol::kFlashPageBytes; i += 2) {
    uint16_t word;
    memcpy(&word, data + i, sizeof(word));
    boot_page_fill(address + i, word);
  }
  boot_page_write(address);
  boot_spm_busy_wait();
  boot_rww_enable();
  return true;
}

}  // namespace bootloader
}  // namespace torquer
