// A firmware image as torquer-flash gets it: an Intel HEX file with the application and its trailer
// (protocol/firmware_image.h), as the firmware's build makes it.
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

/// A whole image: its CRC is right, and it is for our board.
class FlashImage {
 public:
  /// Throws UserError naming file and line, and the remedy, for a file that holds no such image.
  static FlashImage FromFile(const std::string& path);
  /// The same for the flash's contents from address 0; `name` is for the error's text.
  static FlashImage FromFlash(std::span<const std::uint8_t> flash, const std::string& name);

  const protocol::ImageTrailer& trailer() const { return trailer_; }
  FirmwareVersion version() const { return VersionOf(trailer_); }
  /// Pages of the application, from address 0.
  int pages() const { return static_cast<int>(bytes_.size() / protocol::kFlashPageBytes); }
  /// One of them, or with index pages() the trailer's.
  std::vector<std::uint8_t> Page(int index) const;
  /// Where that page lies.
  std::uint16_t PageAddress(int index) const;

 private:
  std::vector<std::uint8_t> bytes_;  // the application, filled with 0xff to the end of its page
  protocol::ImageTrailer trailer_{};
};

/// The flash's contents that an Intel HEX file holds, 0xff where it holds nothing. Throws UserError
/// naming file and line.
std::vector<std::uint8_t> ReadHexFile(const std::string& path);

/// Writes such a file with the pages from `first` to before `last`, and nothing else.
/// Throws UserError if it cannot be written.
void WriteHexFile(const std::string& path, const FlashImage& image, int first, int last);

/// The trailer compiled into `flash`, with length and CRC filled in. Throws UserError naming the
/// file if there is none or the application is too long.
protocol::ImageTrailer SignImage(std::span<const std::uint8_t> flash, const std::string& name);

}  // namespace torquer::tools
