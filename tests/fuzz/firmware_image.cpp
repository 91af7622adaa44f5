// Fuzz target for firmware as Intel HEX, and for the image's trailer in the flash.
#include <cstring>

#include "host/tools/flash_image.h"
#include "tests/fuzz/target.h"
#include "tests/support/file_contents.h"
#include "tests/support/temporary_folder.h"

namespace torquer::fuzz::firmware_image_target {
namespace {

using protocol::ImageTrailer;
using protocol::kImageTrailerAddress;

// Flash content with an application and its trailer.
Bytes Flash(const Bytes& application) {
  Bytes flash(kImageTrailerAddress + sizeof(ImageTrailer), 0xff);
  std::copy(application.begin(), application.end(), flash.begin());
  ImageTrailer trailer{};
  trailer.magic = protocol::kImageMagic;
  trailer.board = protocol::kBoardBenchAtmega32u4;
  trailer.clock = 16;
  std::memcpy(&flash[kImageTrailerAddress], &trailer, sizeof trailer);
  trailer = tools::MakeTrailer(flash, "seed");
  std::memcpy(&flash[kImageTrailerAddress], &trailer, sizeof trailer);
  return flash;
}

Bytes Application() {
  Bytes application(200);
  for (std::size_t k = 0; k < application.size(); ++k) {
    application[k] = static_cast<std::uint8_t>(7 * k);
  }
  return application;
}

std::vector<Bytes> HexSeeds() {
  const auto image = tools::FlashImage::FromFlash(Flash(Application()), "seed");
  const test::TemporaryFolder folder;
  const std::string path = folder.Path("seed.hex");
  tools::WriteHexFile(path, image, 0, image.pages() + 1);
  return {ToBytes(test::Contents(path))};
}

bool AcceptsHex(std::span<const std::uint8_t> input) {
  const auto flash = tools::ReadHexFile(FileWith(input));
  tools::FlashImage::FromFlash(flash, "fuzz.hex");
  return true;
}

int Digit(std::uint8_t c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return 0;
}

// Corrects the checksum at the end of each line.
void RepairHex(Bytes& input) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  for (std::size_t begin = 0; begin < input.size();) {
    const auto from = input.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto end = static_cast<std::size_t>(std::find(from, input.end(), '\n') - input.begin());
    int sum = 0;
    for (std::size_t k = begin + 1; k + 3 < end; k += 2) {
      sum += Digit(input[k]) << 4 | Digit(input[k + 1]);
    }
    if (end > begin + 4) {
      input[end - 2] = static_cast<std::uint8_t>(kDigits[-sum >> 4 & 15]);
      input[end - 1] = static_cast<std::uint8_t>(kDigits[-sum & 15]);
    }
    begin = end + 1;
  }
}

// The trailer comes first, so that a small input is a complete image; the application follows.
constexpr std::size_t kTrailer = sizeof(ImageTrailer);

std::vector<Bytes> TrailerSeeds() {
  const Bytes flash = Flash(Application());
  Bytes input(flash.end() - kTrailer, flash.end());
  const Bytes application = Application();
  input.insert(input.end(), application.begin(), application.end());
  return {input};
}

Bytes FlashOf(std::span<const std::uint8_t> input) {
  Reader reader(input);
  const auto trailer = reader.Take(kTrailer);
  const auto application = reader.Take(kImageTrailerAddress);
  Bytes flash(kImageTrailerAddress, 0xff);
  std::copy(application.begin(), application.end(), flash.begin());
  flash.insert(flash.end(), trailer.begin(), trailer.end());
  return flash;
}

bool AcceptsTrailer(std::span<const std::uint8_t> input) {
  const auto image = tools::FlashImage::FromFlash(FlashOf(input), "fuzz");
  for (int page = 0; page <= image.pages(); ++page) image.Page(page);
  return true;
}

void RepairTrailer(Bytes& input) {
  if (input.size() < kTrailer) return;
  ImageTrailer trailer;
  std::memcpy(&trailer, input.data(), kTrailer);
  trailer.magic = protocol::kImageMagic;
  if (trailer.length == 0 || trailer.length > kImageTrailerAddress) return;
  const Bytes flash = FlashOf(input);
  trailer.crc = protocol::ImageCrc(trailer, [&flash](std::uint16_t at) { return flash[at]; });
  std::memcpy(input.data(), &trailer, kTrailer);
}

const Registration kHex({.name = "hex",
                         .seeds = HexSeeds,
                         .accepts = AcceptsHex,
                         .repair = RepairHex,
                         .replay_inputs = 6000});
const Registration kTrailerTarget({.name = "trailer",
                                   .seeds = TrailerSeeds,
                                   .accepts = AcceptsTrailer,
                                   .repair = RepairTrailer,
                                   .replay_inputs = 1500});

}  // namespace
}  // namespace torquer::fuzz::firmware_image_target
