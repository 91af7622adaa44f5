// A firmware image as the firmware's build makes it: an Intel HEX file with the application and its
// trailer (protocol/firmware_image.h).
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

FirmwareVersion VersionOf(const protocol::ImageTrailer& trailer);

/// A complete image: its CRC is right, and it is for our board.
class FlashImage {
 public:
  /// Throws UserError naming file and line, and the remedy, for a file that holds no such image.
  static FlashImage FromFile(const std::string& path);
  /// The same from the contents of the flash from address 0; `name` is for messages.
  static FlashImage FromFlash(std::span<const std::uint8_t> flash, const std::string& name);

  const protocol::ImageTrailer& trailer() const { return trailer_; }
  FirmwareVersion version() const { return VersionOf(trailer_); }
  /// Pages of the application, from address 0.
  int pages() const { return static_cast<int>(bytes_.size() / protocol::kFlashPageBytes); }
  /// One of them; index pages() is the page of the trailer.
  std::vector<std::uint8_t> Page(int index) const;
  /// The address of that page.
  std::uint16_t PageAddress(int index) const;

 private:
  std::vector<std::uint8_t> bytes_;  // the application, filled with 0xff to the end of its page
  protocol::ImageTrailer trailer_{};
};

/// The contents of the flash in an Intel HEX file, 0xff where the file has none. Throws UserError
/// naming file and line.
std::vector<std::uint8_t> ReadHexFile(const std::string& path);

/// Writes such a file with the pages `first` .. `last` - 1 only.
/// Throws UserError if it cannot be written.
void WriteHexFile(const std::string& path, const FlashImage& image, int first, int last);

/// The trailer that is compiled into `flash`, with length and CRC filled in. Throws UserError
/// naming the file if there is none, or no application.
protocol::ImageTrailer MakeTrailer(std::span<const std::uint8_t> flash, const std::string& name);

}  // namespace torquer::tools
