#include "host/tools/flash_image.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <optional>
#include <ostream>
#include <sstream>
#include <tuple>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/input_file.h"

namespace torquer::tools {
namespace {

using protocol::ImageTrailer;
using protocol::kFlashPageBytes;
using protocol::kImageTrailerAddress;

constexpr std::size_t kFlashBytes = 32768;
constexpr char kRemedy[] = "give the torquer-firmware*.hex that the firmware's build made";

enum HexRecord { kData = 0, kEndOfFile = 1, kSegment = 2, kStartSegment = 3, kLinear = 4 };

bool IsKnownClock(std::uint8_t clock) {
  return clock == protocol::ClockCode(8, 8) || clock == protocol::ClockCode(16, 16) ||
         clock == protocol::ClockCode(16, 8);
}

std::optional<ImageTrailer> TrailerIn(std::span<const std::uint8_t> flash) {
  ImageTrailer trailer{};
  if (flash.size() < kImageTrailerAddress + sizeof(trailer)) return std::nullopt;
  std::memcpy(&trailer, &flash[kImageTrailerAddress], sizeof(trailer));
  if (trailer.magic != protocol::kImageMagic) return std::nullopt;
  return trailer;
}

// Decodes the bytes of one line after the colon. Returns nullopt if the line is not made of pairs
// of hexadecimal digits.
std::optional<std::vector<std::uint8_t>> BytesOfLine(const std::string& line) {
  if (line.size() % 2 == 0) return std::nullopt;
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 1; i < line.size(); i += 2) {
    const char* const digits = &line[i];
    std::uint8_t byte = 0;
    const auto [end, error] = std::from_chars(digits, digits + 2, byte, 16);
    if (error != std::errc() || end != digits + 2) return std::nullopt;
    bytes.push_back(byte);
  }
  return bytes;
}

std::string HexLine(int address, HexRecord kind, std::span<const std::uint8_t> data) {
  unsigned sum = static_cast<unsigned>(data.size()) + static_cast<unsigned>(address >> 8) +
                 static_cast<unsigned>(address & 0xff) + kind;
  std::string line =
      fmt::format(":{:02X}{:04X}{:02X}", data.size(), address, static_cast<int>(kind));
  for (const std::uint8_t byte : data) {
    line += fmt::format("{:02X}", byte);
    sum += byte;
  }
  return line + fmt::format("{:02X}\n", (0x100 - (sum & 0xff)) & 0xff);
}

}  // namespace

std::string FirmwareVersion::Text() const { return fmt::format("{}.{}.{}", major, minor, patch); }

bool FirmwareVersion::IsOlderThan(const FirmwareVersion& other) const {
  return std::tie(major, minor, patch) < std::tie(other.major, other.minor, other.patch);
}

std::string ClockText(int crystal_mhz, int cpu_mhz) {
  return crystal_mhz == cpu_mhz
             ? fmt::format("{} MHz", cpu_mhz)
             : fmt::format("{} MHz from a crystal of {} MHz", cpu_mhz, crystal_mhz);
}

std::string BoardText(int board) {
  switch (board) {
    case protocol::kBoardBenchAtmega32u4:
      return "board 1 (one sensor)";
    case protocol::kBoardTwoSensorsAtmega32u4:
      return "board 2 (two sensors)";
    default:
      return fmt::format("board {}", board);
  }
}

std::string KnownBoardsText() {
  return BoardText(protocol::kBoardBenchAtmega32u4) + " and " +
         BoardText(protocol::kBoardTwoSensorsAtmega32u4);
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
    throw UserError(fmt::format(
        "{}: is not firmware of the bench device (it has no image trailer); {}", name, kRemedy));
  }
  if (!protocol::IsKnownBoard(trailer->board) || !IsKnownClock(trailer->clock)) {
    throw UserError(
        fmt::format("{}: is for {} with clock {}; this program supports {}, with clock 8, 16 or "
                    "{}; {}",
                    name, BoardText(trailer->board), trailer->clock, KnownBoardsText(),
                    protocol::ClockCode(16, 8), kRemedy));
  }
  if (!protocol::ImageIsWhole(*trailer, [flash](std::uint16_t at) { return flash[at]; })) {
    throw UserError(fmt::format(
        "{}: the image is damaged: its bytes do not have the CRC that its trailer names; {}", name,
        kRemedy));
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
  std::istringstream file(ReadInputFile(path, kRemedy));
  std::vector<std::uint8_t> flash;
  std::string line;
  int number = 0;
  bool ended = false;
  const auto wrong = [&](const std::string& what) {
    return UserError(fmt::format("{}:{}: {}; {}", path, number, what, kRemedy));
  };
  while (!ended && std::getline(file, line)) {
    ++number;
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    const auto bytes = line[0] == ':' ? BytesOfLine(line) : std::nullopt;
    if (!bytes || bytes->size() < 5 || bytes->size() != std::size_t{5} + bytes->front()) {
      throw wrong("is not a line of an Intel HEX file");
    }
    unsigned sum = 0;
    for (const std::uint8_t byte : *bytes) sum += byte;
    if ((sum & 0xff) != 0) throw wrong("the checksum of the line is wrong: the file is damaged");
    const std::size_t address = static_cast<std::size_t>((*bytes)[1] << 8 | (*bytes)[2]);
    const std::span<const std::uint8_t> data(bytes->data() + 4, bytes->front());
    switch ((*bytes)[3]) {
      case kData:
        if (address + data.size() > kFlashBytes) throw wrong("is beyond the chip's flash");
        if (flash.size() < address + data.size()) flash.resize(address + data.size(), 0xff);
        std::copy(data.begin(), data.end(), flash.begin() + static_cast<std::ptrdiff_t>(address));
        break;
      case kEndOfFile:
        ended = true;
        break;
      case kSegment:
      case kLinear:
        if (std::any_of(data.begin(), data.end(), [](std::uint8_t byte) { return byte != 0; })) {
          throw wrong("is beyond the chip's flash");
        }
        break;
      default:  // a start address has no meaning for this chip
        break;
    }
  }
  if (!ended) {
    ++number;
    throw wrong("the last line is missing: the file is incomplete");
  }
  return flash;
}

void WriteHexFile(const std::string& path, const FlashImage& image, int first, int last) {
  AtomicFile file(path);
  constexpr std::size_t kLineBytes = 16;
  for (int index = first; index < last; ++index) {
    const std::vector<std::uint8_t> page = image.Page(index);
    for (std::size_t at = 0; at < page.size(); at += kLineBytes) {
      file.out() << HexLine(image.PageAddress(index) + static_cast<int>(at), kData,
                            std::span(page).subspan(at, kLineBytes));
    }
  }
  file.out() << HexLine(0, kEndOfFile, {});
  file.Finish();
}

ImageTrailer MakeTrailer(std::span<const std::uint8_t> flash, const std::string& name) {
  std::optional<ImageTrailer> trailer = TrailerIn(flash);
  if (!trailer) throw UserError(fmt::format("{}: has no image trailer to fill in", name));
  std::size_t length = kImageTrailerAddress;
  while (length > 0 && flash[length - 1] == 0xff) --length;
  if (length == 0) throw UserError(fmt::format("{}: holds no application", name));
  trailer->length = static_cast<std::uint16_t>(length);
  trailer->crc = protocol::ImageCrc(*trailer, [flash](std::uint16_t at) { return flash[at]; });
  return *trailer;
}

}  // namespace torquer::tools
