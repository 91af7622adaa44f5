#include "host/tools/flash_image.h"

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <optional>
#include <tuple>

#include "host/support/error.h"

namespace torquer::tools {
namespace {

using protocol::ImageTrailer;
using protocol::kFlashPageBytes;
using protocol::kImageTrailerAddress;

constexpr std::size_t kFlashBytes = 32768;
constexpr char kRemedy[] = "; give the torquer-firmware*.hex that the firmware's build made";

enum HexRecord { kData = 0, kEndOfFile = 1, kSegment = 2, kStartSegment = 3, kLinear = 4 };

std::optional<ImageTrailer> TrailerIn(std::span<const std::uint8_t> flash) {
  ImageTrailer trailer{};
  if (flash.size() < kImageTrailerAddress + sizeof(trailer)) return std::nullopt;
  std::memcpy(&trailer, &flash[kImageTrailerAddress], sizeof(trailer));
  if (trailer.magic != protocol::kImageMagic) return std::nullopt;
  return trailer;
}

// The bytes of one line, without the colon; nothing if it is not of pairs of hexadecimal digits.
std::optional<std::vector<std::uint8_t>> BytesOfLine(const std::string& line) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 1; i + 1 < line.size() + 1; i += 2) {
    if (i + 1 >= line.size()) return std::nullopt;
    unsigned value = 0;
    const char pair[3] = {line[i], line[i + 1], 0};
    if (!std::isxdigit(static_cast<unsigned char>(pair[0])) ||
        !std::isxdigit(static_cast<unsigned char>(pair[1])) ||
        std::sscanf(pair, "%2x", &value) != 1) {
      return std::nullopt;
    }
    bytes.push_back(static_cast<std::uint8_t>(value));
  }
  return bytes;
}

void PutLine(std::FILE* file, int address, HexRecord kind, std::span<const std::uint8_t> data) {
  unsigned sum = static_cast<unsigned>(data.size()) + static_cast<unsigned>(address >> 8) +
                 static_cast<unsigned>(address & 0xff) + kind;
  std::fprintf(file, ":%02X%04X%02X", static_cast<unsigned>(data.size()),
               static_cast<unsigned>(address), static_cast<unsigned>(kind));
  for (const std::uint8_t byte : data) {
    std::fprintf(file, "%02X", byte);
    sum += byte;
  }
  std::fprintf(file, "%02X\n", (0x100 - (sum & 0xff)) & 0xff);
}

}  // namespace

std::string FirmwareVersion::Text() const {
  return std::to_string(major) + "." + std::to_string(minor) + "." + std::to_string(patch);
}

bool FirmwareVersion::IsOlderThan(const FirmwareVersion& other) const {
  return std::tie(major, minor, patch) < std::tie(other.major, other.minor, other.patch);
}

FirmwareVersion VersionOf(const ImageTrailer& trailer) {
  return {trailer.firmware_major, trailer.firmware_minor, trailer.firmware_patch};
}

FlashImage FlashImage::FromFile(const std::string& path) {
  return FromFlash(ReadHexFile(path), path);
}

FlashImage FlashImage::FromFlash(std::span<const std::uint8_t> flash, const std::string& name) {
  const std::optional<ImageTrailer> trailer = TrailerIn(flash);
  if (!trailer) {
    throw UserError(name + ": is no firmware of the bench device (it has no image trailer)" +
                    kRemedy);
  }
  if (trailer->board != protocol::kBoardBenchAtmega32u4 ||
      (trailer->clock_mhz != 8 && trailer->clock_mhz != 16)) {
    throw UserError(name + ": is for board " + std::to_string(trailer->board) + " at " +
                    std::to_string(trailer->clock_mhz) + " MHz, where ours is board " +
                    std::to_string(protocol::kBoardBenchAtmega32u4) + " at 8 or 16 MHz" + kRemedy);
  }
  if (!protocol::ImageIsWhole(*trailer, [flash](std::uint16_t at) { return flash[at]; })) {
    throw UserError(name +
                    ": the image is damaged: its bytes do not have the CRC that its trailer "
                    "gives" +
                    kRemedy);
  }
  FlashImage image;
  image.trailer_ = *trailer;
  image.bytes_.assign(flash.begin(), flash.begin() + trailer->length);
  const std::size_t pages = (image.bytes_.size() + kFlashPageBytes - 1) / kFlashPageBytes;
  image.bytes_.resize(pages * kFlashPageBytes, 0xff);
  return image;
}

std::vector<std::uint8_t> FlashImage::Page(int index) const {
  std::vector<std::uint8_t> page(kFlashPageBytes, 0xff);
  if (index < pages()) {
    std::copy_n(bytes_.begin() + index * kFlashPageBytes, kFlashPageBytes, page.begin());
  } else {
    std::memcpy(page.data(), &trailer_, sizeof(trailer_));
  }
  return page;
}

std::uint16_t FlashImage::PageAddress(int index) const {
  return index < pages() ? static_cast<std::uint16_t>(index * kFlashPageBytes)
                         : kImageTrailerAddress;
}

std::vector<std::uint8_t> ReadHexFile(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw UserError(path + ": cannot be opened" + kRemedy);
  std::vector<std::uint8_t> flash;
  std::string line;
  int number = 0;
  bool ended = false;
  const auto wrong = [&](const std::string& what) {
    return UserError(path + ":" + std::to_string(number) + ": " + what + kRemedy);
  };
  while (!ended && std::getline(file, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    const auto bytes = line[0] == ':' ? BytesOfLine(line) : std::nullopt;
    if (!bytes || bytes->size() < 5 || bytes->size() != std::size_t{5} + bytes->front()) {
      throw wrong("is no line of an Intel HEX file");
    }
    unsigned sum = 0;
    for (const std::uint8_t byte : *bytes) sum += byte;
    if ((sum & 0xff) != 0) throw wrong("the line's check sum is wrong: the file is damaged");
    const std::size_t address = static_cast<std::size_t>((*bytes)[1] << 8 | (*bytes)[2]);
    const std::span<const std::uint8_t> data(bytes->data() + 4, bytes->front());
    switch ((*bytes)[3]) {
      case kData:
        if (address + data.size() > kFlashBytes) throw wrong("lies beyond the chip's flash");
        if (flash.size() < address + data.size()) flash.resize(address + data.size(), 0xff);
        std::copy(data.begin(), data.end(), flash.begin() + static_cast<std::ptrdiff_t>(address));
        break;
      case kEndOfFile:
        ended = true;
        break;
      case kSegment:
      case kLinear:
        if (std::any_of(data.begin(), data.end(), [](std::uint8_t byte) { return byte != 0; })) {
          throw wrong("lies beyond the chip's flash");
        }
        break;
      default:  // a start address says nothing to this chip
        break;
    }
  }
  if (!ended) {
    ++number;
    throw wrong("the file ends before its last line: it is cut short");
  }
  return flash;
}

void WriteHexFile(const std::string& path, const FlashImage& image, int first, int last) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  if (!file) throw UserError(path + ": cannot be written: " + std::strerror(errno));
  constexpr std::size_t kLineBytes = 16;
  for (int index = first; index < last; ++index) {
    const std::vector<std::uint8_t> page = image.Page(index);
    for (std::size_t at = 0; at < page.size(); at += kLineBytes) {
      PutLine(file, image.PageAddress(index) + static_cast<int>(at), kData,
              std::span(page).subspan(at, kLineBytes));
    }
  }
  PutLine(file, 0, kEndOfFile, {});
  const bool failed = std::ferror(file) != 0;
  if (std::fclose(file) != 0 || failed) throw UserError(path + ": cannot be written");
}

ImageTrailer SignImage(std::span<const std::uint8_t> flash, const std::string& name) {
  std::optional<ImageTrailer> trailer = TrailerIn(flash);
  if (!trailer) throw UserError(name + ": has no trailer at its place to be filled in");
  std::size_t length = kImageTrailerAddress;
  while (length > 0 && flash[length - 1] == 0xff) --length;
  if (length == 0) throw UserError(name + ": holds no application");
  trailer->length = static_cast<std::uint16_t>(length);
  trailer->crc = protocol::ImageCrc(*trailer, [flash](std::uint16_t at) { return flash[at]; });
  return *trailer;
}

}  // namespace torquer::tools
