// Layout of a firmware image in the device's flash. The application begins at address 0, and a
// separate page holds a trailer. The trailer is written last and proves that the image is complete.
//
// Its readers are the bootloader, the application's self-test, the build step that fills in the
// trailer, torquer-flash and the emulator. C++14 under avr-gcc, C++20 on the host, as
// hid_reports.h.
#pragma once

#include <stddef.h>
#include <stdint.h>

namespace torquer {
namespace protocol {

constexpr uint16_t kFlashPageBytes = 128;
/// Address of the trailer's page; the application ends below it. The 4 KiB above it have room for
/// the largest bootloader, so that one image fits every board.
constexpr uint16_t kImageTrailerAddress = 0x6f80;
/// Start of the Torquer bootloader, 2 KiB to the end of the flash.
constexpr uint16_t kBootloaderAddress = 0x7800;
constexpr uint16_t kBootloaderBytes = 0x0800;

/// "TQFW"
constexpr uint32_t kImageMagic = 0x57465154;

/// Circuit of an image. A new pin assignment needs a new number.
enum ImageBoard : uint8_t {
  kBoardBenchAtmega32u4 = 1,
  kBoardTwoSensorsAtmega32u4 = 2,  ///< as board 1, and a sensor of the catheter
};
/// True for the numbers above.
constexpr bool IsKnownBoard(uint8_t board) {
  return board == kBoardBenchAtmega32u4 || board == kBoardTwoSensorsAtmega32u4;
}

/// Crystal and CPU clock in a byte: the crystal in MHz. Bit kHalfClock is set if the CPU runs at
/// half of it. Programs that do not know this bit refuse the clock.
constexpr uint8_t kHalfClock = 0x80;
constexpr uint8_t ClockCode(uint8_t crystal_mhz, uint8_t cpu_mhz) {
  return static_cast<uint8_t>(crystal_mhz | (cpu_mhz < crystal_mhz ? kHalfClock : 0));
}
constexpr uint8_t CrystalMhz(uint8_t clock) { return static_cast<uint8_t>(clock & ~kHalfClock); }
constexpr uint8_t CpuMhz(uint8_t clock) {
  return static_cast<uint8_t>(CrystalMhz(clock) >> (clock & kHalfClock ? 1 : 0));
}

// clang-format off
#define TORQUER_IMAGE_TRAILER(FIELD)                                                               \
  FIELD(uint32_t, magic,             "kImageMagic")                                                \
  FIELD(uint16_t, length,            "bytes of the application, from address 0; 1 .. 28544")       \
  FIELD(uint8_t,  board,             "ImageBoard")                                                 \
  FIELD(uint8_t,  clock,             "ClockCode() of crystal and CPU that it was built for")       \
  FIELD(uint8_t,  firmware_major,    "firmware version")                                           \
  FIELD(uint8_t,  firmware_minor,    "firmware version")                                           \
  FIELD(uint8_t,  firmware_patch,    "firmware version")                                           \
  FIELD(uint8_t,  protocol_version,  "kProtocolVersion that it speaks")                            \
  FIELD(uint32_t, crc,               "CRC-32 of the application and the 12 bytes above")
// clang-format on

#define TORQUER_FIELD(type, name, meaning) type name;
/// The trailer is written last, so an incomplete image has no matching trailer.
struct __attribute__((packed)) ImageTrailer {
  TORQUER_IMAGE_TRAILER(TORQUER_FIELD)
};
#undef TORQUER_FIELD

static_assert(sizeof(ImageTrailer) == 16, "see the byte table in README.md");
constexpr uint8_t kTrailerBytesInCrc = offsetof(ImageTrailer, crc);
static_assert(kTrailerBytesInCrc == 12, "the CRC covers all before it");

/// CRC-32 (IEEE 802.3, reflected), a byte at a time, from kCrc32Start; kCrc32Xor ends it.
constexpr uint32_t kCrc32Start = 0xffffffff;
constexpr uint32_t kCrc32Xor = 0xffffffff;
__attribute__((noinline)) inline uint32_t Crc32Step(uint32_t crc, uint8_t byte) {
  crc ^= byte;
  for (uint8_t bit = 0; bit < 8; ++bit) {
    const uint8_t low = static_cast<uint8_t>(crc);  // one byte: the chip has no wider registers
    crc >>= 1;
    if (low & 1) {
      asm volatile("");  // keeps the branch: a mask of 32 bits takes the chip twice as long
      crc ^= 0xedb88320;
    }
  }
  return crc;
}

/// CRC that `trailer` must have. `read(address)` returns the application's bytes.
template <typename Read>
uint32_t ImageCrc(const ImageTrailer& trailer, Read read) {
  uint32_t crc = kCrc32Start;
  for (uint16_t address = 0; address < trailer.length; ++address) {
    crc = Crc32Step(crc, read(address));
  }
  const uint8_t* bytes = reinterpret_cast<const uint8_t*>(&trailer);
  for (uint8_t i = 0; i < kTrailerBytesInCrc; ++i) crc = Crc32Step(crc, bytes[i]);
  return crc ^ kCrc32Xor;
}

/// True if `trailer` is valid and matches the application.
template <typename Read>
bool ImageIsWhole(const ImageTrailer& trailer, Read read) {
  return trailer.magic == kImageMagic && trailer.length != 0 &&
         trailer.length <= kImageTrailerAddress && ImageCrc(trailer, read) == trailer.crc;
}

}  // namespace protocol
}  // namespace torquer
