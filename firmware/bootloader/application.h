// The application in the flash: whether it is whole, and how it is replaced.
#pragma once

#include <stdint.h>

#include "protocol/firmware_image.h"

namespace torquer {
namespace bootloader {

/// The trailer as it lies in the flash.
void ReadTrailer(protocol::ImageTrailer* trailer);

/// True if `trailer` matches the bytes in the flash, this board and its crystal. Takes up to 0.2 s
/// (8 MHz: 0.4 s); the watchdog may run meanwhile.
bool Fits(const protocol::ImageTrailer& trailer);

/// Erases and programs a page of the application, or its trailer's; 9 to 13 ms. Before its first
/// page the application is made invalid, and only a trailer that fits makes it valid again. False,
/// and nothing changed, if the trailer does not fit or the page is another.
/// `trailer_erased` is kept for the caller from page to page; false at the start.
bool WritePage(uint16_t address, const uint8_t data[protocol::kFlashPageBytes],
               bool* trailer_erased);

}  // namespace bootloader
}  // namespace torquer
