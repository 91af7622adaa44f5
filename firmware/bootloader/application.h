// The application in the flash: checks that it is complete, and replaces it page by page.
#pragma once

#include <stdint.h>

#include "protocol/firmware_image.h"

namespace torquer {
namespace bootloader {

/// The trailer as stored in the flash.
void ReadTrailer(protocol::ImageTrailer* trailer);

/// True if `trailer` matches the bytes in the flash, this board and its crystal. Takes up to 0.2 s
/// (8 MHz: 0.4 s); the watchdog may run meanwhile.
bool Fits(const protocol::ImageTrailer& trailer);

/// Erases and programs a page of the application, or the page of its trailer; 9 to 13 ms. The first
/// page makes the application invalid, and only a matching trailer makes it valid again. Returns
/// false without a change if the trailer does not match or the page is not part of the application.
/// `trailer_erased` is false at the start; the caller keeps it from page to page.
bool WritePage(uint16_t address, const uint8_t data[protocol::kFlashPageBytes],
               bool* trailer_erased);

}  // namespace bootloader
}  // namespace torquer
