// Real avrdude, run as torquer-flash runs it, against a board in Caterina. Tests the order of page
// writes, and messages when the board is lost.
#include "host/tools/caterina.h"

#include <fcntl.h>
#include <termios.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>

#include "host/support/error.h"
#include "host/tools/flash_procedure.h"
#include "tests/flash/caterina_responder.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::test::CaterinaResponder;
using torquer::tools::AvrdudeOptions;
using torquer::tools::FlashByCaterina;
using torquer::tools::FlashImage;
using torquer::tools::FlashUnfinished;
namespace protocol = torquer::protocol;

FlashImage Image() {
  return FlashImage::FromFile(torquer::test::FirmwarePath("torquer-firmware.hex"));
}

std::string Failure(const std::string& port, const AvrdudeOptions& options) {
  try {
    FlashByCaterina(port, Image(), options);
  } catch (const FlashUnfinished& unfinished) {
    return unfinished.what();
  }
  return "done";
}

}  // namespace

TEST_CASE("a board in Caterina gets its first page last, and is verified") {
  CaterinaResponder board;
  const FlashImage image = Image();
  FlashByCaterina(board.port(), image, {});
  const std::vector<std::string> log = board.log();
  CAPTURE(log);

  std::vector<std::string> wanted = {"erase"};
  for (int i = 1; i < image.pages(); ++i) wanted.push_back("write " + std::to_string(i));
  wanted.push_back("write " +
                   std::to_string(protocol::kImageTrailerAddress / protocol::kFlashPageBytes));
  wanted.emplace_back("write 0");
  REQUIRE(log.size() > wanted.size());
  CHECK(std::vector<std::string>(
            log.begin(), log.begin() + static_cast<std::ptrdiff_t>(wanted.size())) == wanted);
  CHECK(log[wanted.size()] == "read 0");
  CHECK(log.back() == "exit");

  const std::vector<std::uint8_t> flash = board.flash();
  for (int i = 0; i <= image.pages(); ++i) {
    const std::vector<std::uint8_t> page = image.Page(i);
    REQUIRE(std::equal(page.begin(), page.end(), flash.begin() + image.PageAddress(i)));
  }
}

TEST_CASE("avrdude ends with a lost board, and the user gets the remedy") {
  CaterinaResponder board;
  AvrdudeOptions options;
  SECTION("in the midst of the writing") {
    board.FallSilentAfter(20);
    options.timeout_s = 2;
  }
  SECTION("from the beginning") {
    board.FallSilentAfter(0);
    options.timeout_s = 1;
  }
  SECTION("and the user has enough") {
    board.FallSilentAfter(3);
    options.stop = [&board] { return board.writes() == 3; };
  }
  const std::string said = Failure(board.port(), options);
  CHECK_THAT(said, Contains("run the same command again"));
  CHECK_THAT(said, Contains("Caterina") && Contains("reset it"));
  // The first page is still blank: Caterina checks it to decide whether an application is present.
  CHECK(board.flash()[0] == 0xff);
}

TEST_CASE("a page that does not read back is reported") {
  CaterinaResponder board;
  board.SpoilPage(7);
  CHECK_THAT(Failure(board.port(), {}),
             Contains("avrdude failed with this output:") && Contains("verif"));
}

TEST_CASE("an invalid port and a missing avrdude are reported") {
  CHECK_THAT(Failure("/nonexistent", {}), Contains("/nonexistent"));
  AvrdudeOptions options;
  options.avrdude = "no-such-avrdude";
  CHECK_THROWS_WITH(FlashByCaterina("/dev/null", Image(), options),
                    Contains("apt-get install avrdude"));
}

TEST_CASE("a program that ignores its board and its parent is killed") {
  const torquer::test::TemporaryFolder folder;
  const std::string deaf = folder.Path("deaf");
  {
    std::ofstream script(deaf);
    script << "#!/bin/sh\ntrap '' TERM INT HUP\nwhile :; do sleep 1; done\n";
  }
  std::filesystem::permissions(deaf, std::filesystem::perms::owner_all);
  AvrdudeOptions options;
  options.avrdude = deaf;
  options.timeout_s = 1;
  CHECK_THAT(Failure("/dev/null", options), Contains("did not end within 1 s"));
}

TEST_CASE("1200 baud at its port requests the bootloader of an Arduino program") {
  CaterinaResponder board;  // a pseudo-terminal
  const int tty = open(board.port().c_str(), O_RDWR | O_NOCTTY);
  REQUIRE(tty >= 0);
  torquer::tools::AskSketchIntoCaterina(board.port());
  termios settings{};
  REQUIRE(tcgetattr(tty, &settings) == 0);
  CHECK(cfgetospeed(&settings) == B1200);
  CHECK(cfgetispeed(&settings) == B1200);
  CHECK((settings.c_cflag & HUPCL) != 0);
  close(tty);

  CHECK_THROWS_WITH(torquer::tools::AskSketchIntoCaterina("/nonexistent/tty"),
                    Contains("/nonexistent/tty") && Contains("twice within a second"));
  CHECK_THROWS_WITH(torquer::tools::AskSketchIntoCaterina("/dev/null"),
                    Contains("is not a serial port"));
}
