// Image files: refused files and their error messages.
#include "host/tools/flash_image.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>

#include "host/support/error.h"
#include "tests/support/file_contents.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

using torquer::test::Contents;

namespace {

using Catch::Contains;
using torquer::UserError;
using torquer::tools::FlashImage;
namespace protocol = torquer::protocol;

const std::string kHex = torquer::test::FirmwarePath("torquer-firmware.hex");

// Error message for a file with this text.
std::string RefusalOf(const std::string& text) {
  const torquer::test::TemporaryFolder folder;
  const std::string path = folder.Path("image.hex");
  std::ofstream(path) << text;
  try {
    FlashImage::FromFile(path);
  } catch (const UserError& error) {
    return error.what();
  }
  return "taken";
}

std::string RefusalOfFlash(const std::vector<std::uint8_t>& flash) {
  try {
    FlashImage::FromFlash(flash, "x");
  } catch (const UserError& error) {
    return error.what();
  }
  return "taken";
}

}  // namespace

TEST_CASE("the image that the build made is taken, page for page") {
  const FlashImage image = FlashImage::FromFile(kHex);
  CHECK(image.version().Text() == "0.1.0");
  CHECK(image.trailer().clock == 16);
  CHECK(image.pages() == (image.trailer().length + 127) / 128);
  CHECK(image.PageAddress(image.pages()) == protocol::kImageTrailerAddress);
  const std::vector<std::uint8_t> flash = torquer::tools::ReadHexFile(kHex);
  for (int i = 0; i <= image.pages(); ++i) {
    std::vector<std::uint8_t> page = image.Page(i);
    REQUIRE(page.size() == protocol::kFlashPageBytes);
    for (std::size_t k = 0; k < page.size(); ++k) {
      const std::size_t at = image.PageAddress(i) + k;
      REQUIRE(page[k] == (at < flash.size() ? flash[at] : 0xff));
    }
  }
}

TEST_CASE("an image names its board") {
  CHECK(FlashImage::FromFile(kHex).board() == protocol::kBoardBenchAtmega32u4);
  for (const std::string clock : {"", "-8mhz", "-16to8mhz"}) {
    const FlashImage image = FlashImage::FromFile(
        torquer::test::FirmwarePath("torquer-firmware-two-sensors" + clock + ".hex"));
    CHECK(image.board() == protocol::kBoardTwoSensorsAtmega32u4);
  }
}

TEST_CASE("a written file reads back") {
  const torquer::test::TemporaryFolder folder;
  const FlashImage image = FlashImage::FromFile(kHex);
  WriteHexFile(folder.Path("all.hex"), image, 0, image.pages() + 1);
  const FlashImage again = FlashImage::FromFile(folder.Path("all.hex"));
  CHECK(again.trailer().crc == image.trailer().crc);
  WriteHexFile(folder.Path("first.hex"), image, 0, 1);
  CHECK(torquer::tools::ReadHexFile(folder.Path("first.hex")) == image.Page(0));
  CHECK_THROWS_AS(WriteHexFile(folder.Path("no/such.hex"), image, 0, 1), UserError);
}

TEST_CASE("an incomplete image is refused with its line and the remedy") {
  const std::string good = Contents(kHex);
  CHECK(RefusalOf(good) == "taken");
  CHECK_THAT(RefusalOf(""), Contains("incomplete") && Contains("torquer-firmware*.hex"));
  CHECK_THAT(RefusalOf("Hello"), Contains(":1: is not a line of an Intel HEX file"));
  CHECK_THAT(RefusalOf(":0"), Contains(":1: is not a line"));
  CHECK_THAT(RefusalOf(":00000001F"), Contains(":1: is not a line"));
  CHECK_THAT(RefusalOf(":0500000001FF"), Contains(":1: is not a line"));
  for (const char* line : {":000000g1FF", ":00000001-1", ":0000000 1F", ":000000010xFF"}) {
    CHECK_THAT(RefusalOf(line), Contains(":1: is not a line"));
  }
  CHECK_THAT(RefusalOf(good.substr(0, good.size() / 2)), Contains("image.hex:"));
  CHECK_THAT(RefusalOf(good.substr(0, good.rfind(':'))), Contains("incomplete"));
  std::string damaged = good;
  damaged[1000] = damaged[1000] == '0' ? '1' : '0';
  CHECK_THAT(RefusalOf(damaged), Contains("damaged"));
  CHECK_THAT(RefusalOf(":020000040001F9\n:00000001FF\n"), Contains(":1: is beyond"));
  CHECK_THAT(RefusalOf(":0180000000"
                       "7F\n:00000001FF\n"),
             Contains(":1: is beyond"));
  CHECK_THAT(RefusalOf(":00000001FF\n"), Contains("is not firmware of the bench device"));
  CHECK_THROWS_AS(FlashImage::FromFile("/nonexistent.hex"), UserError);
  // objcopy ends lines with CR LF; LF alone is accepted too.
  std::string plain = good;
  plain.erase(std::remove(plain.begin(), plain.end(), '\r'), plain.end());
  REQUIRE(plain != good);
  CHECK(RefusalOf(plain) == "taken");
}

TEST_CASE("an image for another circuit, or with other bytes than its checksum is of, is refused") {
  const std::vector<std::uint8_t> good = torquer::tools::ReadHexFile(kHex);
  CHECK(RefusalOfFlash(good) == "taken");
  std::vector<std::uint8_t> flash = good;
  flash[protocol::kImageTrailerAddress + 6] = 3;
  CHECK_THAT(RefusalOfFlash(flash), Contains("for board 3 with") &&
                                        Contains("board 1 (one sensor)") &&
                                        Contains("board 2 (two sensors)"));
  flash = good;
  flash[protocol::kImageTrailerAddress + 7] = 12;
  CHECK_THAT(RefusalOfFlash(flash), Contains("clock 12"));
  for (const int at : {0, 0x1000, protocol::kImageTrailerAddress + 5,
                       protocol::kImageTrailerAddress + 8, protocol::kImageTrailerAddress + 15}) {
    flash = good;
    flash[static_cast<std::size_t>(at)] ^= 0x20;
    CHECK_THAT(RefusalOfFlash(flash), Contains("damaged"));
  }
  flash = good;
  flash.resize(0x6000);
  CHECK_THAT(RefusalOfFlash(flash), Contains("no image trailer"));
}

TEST_CASE("signing fills in length and CRC, and refuses other files") {
  std::vector<std::uint8_t> flash = torquer::tools::ReadHexFile(kHex);
  const protocol::ImageTrailer trailer = FlashImage::FromFile(kHex).trailer();
  for (const std::size_t at : {4, 5, 12, 13, 14, 15}) {
    flash[protocol::kImageTrailerAddress + at] = 0;
  }
  const protocol::ImageTrailer made = torquer::tools::MakeTrailer(flash, "x");
  CHECK(made.length == trailer.length);
  CHECK(made.crc == trailer.crc);
  std::fill_n(flash.begin(), protocol::kImageTrailerAddress, std::uint8_t{0xff});
  CHECK_THROWS_AS(torquer::tools::MakeTrailer(flash, "x"), UserError);
  flash.resize(100);
  CHECK_THROWS_AS(torquer::tools::MakeTrailer(flash, "x"), UserError);
}
