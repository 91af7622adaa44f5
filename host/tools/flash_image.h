// Firmware image from the firmware's build: an Intel HEX file with the application and its trailer
// (protocol/firmware_image.h).
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/firmware_image.h"

namespace torquer::tools {

struct FirmwareVersion {
  int major = 0, minor = 0, patch = 0;

  bool operator==(const FirmwareVersion&) const = default;
  bool IsOlderThan(const FirmwareVersion& other) const;
  std::string Text() const;
};

/// Clock for messages: "16 MHz", or "8 MHz from a crystal of 16 MHz".
std::string ClockText(int crystal_mhz, int cpu_mhz);

/// Board for messages: "board 2 (two sensors)"; a number alone if it is unknown.
std::string BoardText(int board);
/// Boards that this program supports, for messages.
std::string KnownBoardsText();

FirmwareVersion VersionOf(const protocol::ImageTrailer& trailer);

/// Complete image with a correct CRC for one of our boards.
class FlashImage {
 public:
  /// Reads a file. Throws UserError with file, line and remedy if it has no such image.
  static FlashImage FromFile(const std::string& path);
  /// Reads the contents of the flash from address 0; `name` is for messages.
  static FlashImage FromFlash(std::span<const std::uint8_t> flash, const std::string& name);

  const protocol::ImageTrailer& trailer() const { return trailer_; }
  FirmwareVersion version() const { return VersionOf(trailer_); }
  int board() const { return trailer_.board; }  ///< protocol::ImageBoard
  int crystal_mhz() const { return protocol::CrystalMhz(trailer_.clock); }
  int cpu_mhz() const { return protocol::CpuMhz(trailer_.clock); }
  /// Pages of the application, from address 0.
  int pages() const { return static_cast<int>(bytes_.size() / protocol::kFlashPageBytes); }
  /// Contents of one page; index pages() is the page of the trailer.
  std::vector<std::uint8_t> Page(int index) const;
  /// Address of that page.
  std::uint16_t PageAddress(int index) const;

 private:
  std::vector<std::uint8_t> bytes_;  // the application, padded with 0xff to a whole page
  protocol::ImageTrailer trailer_{};
};

/// Reads the flash contents from an Intel HEX file; missing bytes are 0xff. Throws UserError with
/// file and line.
std::vector<std::uint8_t> ReadHexFile(const std::string& path);

/// Writes an Intel HEX file with the pages `first` .. `last` - 1 only. Throws UserError if it
/// cannot be written.
void WriteHexFile(const std::string& path, const FlashImage& image, int first, int last);

/// Returns the trailer that is compiled into `flash`, with length and CRC filled in. Throws
/// UserError with the file if there is no trailer or no application.
protocol::ImageTrailer MakeTrailer(std::span<const std::uint8_t> flash, const std::string& name);

}  // namespace torquer::tools
