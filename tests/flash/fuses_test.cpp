// Fuses: verdicts on commercial boards and on ours, and the query through avrdude.
#include "host/tools/fuses.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <regex>

#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace {

using Catch::Contains;
using torquer::UserError;
using torquer::test::TemporaryFolder;
using torquer::tools::AvrdudeOptions;
using torquer::tools::Fuses;
using torquer::tools::FuseVerdict;
using torquer::tools::JudgeFuses;
using torquer::tools::ReadFuses;

std::string Said(const FuseVerdict& verdict) {
  std::string text;
  for (const std::string& line : verdict.lines) text += line + "\n";
  return text;
}

// Stand-in for avrdude: a shell script.
AvrdudeOptions Script(const TemporaryFolder& folder, const std::string& body) {
  const std::string path = folder.Path("avrdude");
  std::ofstream(path) << "#!/bin/sh\n" << body;
  std::filesystem::permissions(path, std::filesystem::perms::owner_all);
  AvrdudeOptions options;
  options.avrdude = path;
  options.timeout_s = 5;
  return options;
}

}  // namespace

TEST_CASE("the fuses that the bootloader's page writes are good, each for its clock") {
  std::ifstream file(torquer::test::SourcePath("/firmware/bootloader/README.md"));
  const std::string page{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  const std::regex line(
      "lfuse:w:0x(..):m -U hfuse:w:0x(..):m -U efuse:w:0x(..):m -U "
      "flash:w:\\S*bootloader(-8mhz|-16to8mhz)?"
      "\\.hex:i -U lock:w:0x(..):m");
  int lines = 0;
  for (std::sregex_iterator match(page.begin(), page.end(), line), end; match != end; ++match) {
    const auto value = [&](std::size_t group) {
      return static_cast<std::uint8_t>(std::stoi((*match)[group], nullptr, 16));
    };
    const FuseVerdict verdict = JudgeFuses({value(1), value(2), value(3), value(5)});
    CAPTURE(Said(verdict));
    CHECK(verdict.good);
    const std::string clock = (*match)[4].matched ? "8 MHz" : "16 MHz";
    CHECK_THAT(Said(verdict), Contains("right for " + clock) && Contains("as ours is") &&
                                  Contains("protected from the application") &&
                                  Contains("EEPROM: kept"));
    ++lines;
  }
  CHECK(lines == 3);
}

TEST_CASE("boards with the factory's fuses") {
  // Arduino's definition of the Leonardo and the Micro: 16 MHz with 2.6 V.
  const FuseVerdict leonardo = JudgeFuses({0xff, 0xd8, 0xcb, 0xef});
  CHECK(leonardo.good);
  CHECK_THAT(Said(leonardo),
             Contains("as Arduino's is") &&
                 Contains("too low for 16 MHz, which needs 4.5 V: write efuse 0xc8"));
  // A board at 3.3 V, without brown-out detection.
  const FuseVerdict none = JudgeFuses({0xff, 0xd8, 0xff, 0xef});
  CHECK_FALSE(none.good);
  CHECK_THAT(Said(none), Contains("brown-out detection is off"));
  // Factory state: internal oscillator, divided by 8, JTAG on, the chip's own bootloader.
  const FuseVerdict factory = JudgeFuses({0x52, 0x99, 0xf3, 0xff});
  CHECK_FALSE(factory.good);
  CHECK_THAT(Said(factory), Contains("not the crystal") && Contains("divided by 8") &&
                                Contains("JTAG") && Contains("past the bootloader"));
}

TEST_CASE("each fuse that makes a board unsafe is found by itself") {
  const Fuses good{0xff, 0xd2, 0xc8, 0xef};
  REQUIRE(JudgeFuses(good).good);
  for (int level = 0; level < 8; ++level) {
    Fuses fuses = good;
    fuses.extended = static_cast<std::uint8_t>(0xc8 | level);
    CAPTURE(level);
    CHECK(JudgeFuses(fuses).good == (level <= 3));  // 2.6 V or more
  }
  for (const auto& [low, high] : {std::pair{0xf7, 0xd2},
                                  {0xff, 0xf2},
                                  {0xff, 0xc2},
                                  {0xff, 0xd3},
                                  {0xff, 0xd4},
                                  {0xff, 0xd6}}) {
    Fuses fuses = good;
    fuses.low = static_cast<std::uint8_t>(low);
    fuses.high = static_cast<std::uint8_t>(high);
    CAPTURE(low, high);
    CHECK_FALSE(JudgeFuses(fuses).good);
  }
  Fuses open = good;
  open.lock = 0xff;
  CHECK_THAT(Said(JudgeFuses(open)), Contains("could overwrite it"));
}

TEST_CASE("fuses are read by avrdude, and only read") {
  const TemporaryFolder folder;
  const AvrdudeOptions options = Script(folder, R"(
echo "$@" > ")" + folder.Path("words") + R"("
for word in "$@"; do
  case $word in
    lfuse:r:*:h) f=${word#lfuse:r:}; echo 0xff > "${f%:h}";;
    hfuse:r:*:h) f=${word#hfuse:r:}; echo 0xd8 > "${f%:h}";;
    efuse:r:*:h) f=${word#efuse:r:}; echo 0xcb > "${f%:h}";;
    lock:r:*:h) f=${word#lock:r:}; echo 0x2f > "${f%:h}";;
  esac
done
)");
  const Fuses fuses = ReadFuses("usbasp", "/dev/ttyUSB7", options);
  CHECK(fuses.low == 0xff);
  CHECK(fuses.high == 0xd8);
  CHECK(fuses.extended == 0xcb);
  CHECK(fuses.lock == 0x2f);
  std::ifstream file(folder.Path("words"));
  const std::string words{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  CHECK_THAT(words, Contains("-p m32u4 -c usbasp") && Contains("-P /dev/ttyUSB7") &&
                        !Contains(":w:") && !Contains(" -e"));
}

TEST_CASE("fuses that cannot be read are reported with what avrdude said") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(ReadFuses("usbasp", "", Script(folder, "echo no device found; exit 1\n")),
                    Contains("usbasp") && Contains("no device found") && Contains("six wires"));
  CHECK_THROWS_WITH(ReadFuses("usbasp", "", Script(folder, "echo fine\n")), Contains("fine"));
  AvrdudeOptions slow = Script(folder, "sleep 60\n");
  slow.timeout_s = 1;
  CHECK_THROWS_AS(ReadFuses("usbasp", "", slow), UserError);
  AvrdudeOptions missing;
  missing.avrdude = folder.Path("none");
  CHECK_THROWS_WITH(ReadFuses("usbasp", "", missing), Contains("apt-get install avrdude"));
}
