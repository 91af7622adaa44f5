#include "host/recorder/video_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cstdint>
#include <string>
#include <string_view>

namespace torquer {
namespace {

std::int64_t SizeOfVideo(int file) {
  struct stat status {};
  return fstat(file, &status) == 0 ? status.st_size : 0;
}

// Reads up to `size` bytes at `offset`.
std::string BytesAt(int file, std::int64_t offset, std::size_t size) {
  std::string bytes(size, '\0');
  const ssize_t got = pread(file, bytes.data(), size, offset);
  bytes.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
  return bytes;
}

std::uint64_t BigEndian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<std::uint8_t>(byte);
  return value;
}

}  // namespace

bool IsMp4(int file) {
  const std::int64_t size = SizeOfVideo(file);
  bool data = false;
  bool index = false;
  constexpr std::size_t kHeader = 16;
  for (std::int64_t at = 0; at < size;) {
    const std::string head = BytesAt(file, at, kHeader);
    if (head.size() < 8) return false;
    const std::string kind = head.substr(4, 4);
    std::uint64_t length = BigEndian(head.substr(0, 4));
    // The 64-bit length of a large box follows its type.
    if (length == 1 && head.size() == kHeader) length = BigEndian(head.substr(8));
    if (length < 8 || length > static_cast<std::uint64_t>(size - at)) return false;
    if (at == 0 && kind != "ftyp") return false;
    data = data || (kind == "mdat" && length > kHeader);
    index = index || kind == "moov";
    at += static_cast<std::int64_t>(length);
  }
  return data && index;
}

bool IsWebm(int file) {
  constexpr std::size_t kLooked = 128;
  const std::string head = BytesAt(file, 0, kLooked);
  constexpr std::string_view kEbml = "\x1a\x45\xdf\xa3";
  constexpr std::string_view kSegment = "\x18\x53\x80\x67";
  const bool begins = head.starts_with(kEbml) && head.find("webm") != std::string::npos;
  return begins && head.find(kSegment) != std::string::npos &&
         SizeOfVideo(file) > static_cast<std::int64_t>(kLooked);
}

}  // namespace torquer
