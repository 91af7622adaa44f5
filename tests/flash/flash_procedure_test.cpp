// Procedure of torquer-flash with the real bootloader and the real firmware, in the emulator.
#include <catch2/catch.hpp>
#include <cstring>

#include "tests/flash/emulated_boards.h"
#include "tests/support/paths.h"

namespace {

using Catch::Contains;
using torquer::UserError;
using torquer::emulator::BenchOptions;
using torquer::emulator::ControlResult;
using torquer::emulator::FirmwareImage;
using torquer::test::Bootloader;
using torquer::test::EmulatedBoards;
using torquer::test::kNewHex;
using torquer::test::kNewVersion;
using torquer::test::kOldHex;
using torquer::test::kOldVersion;
using torquer::test::kSlowHex;
using torquer::test::MessageOf;
using torquer::test::WithApplication;
using torquer::tools::BoardMode;
using torquer::tools::FlashRequest;
using torquer::tools::FlashUnfinished;
namespace protocol = torquer::protocol;

// Checks that the flash contains the image, from its first byte to its trailer.
void CheckInstalled(const EmulatedBoards& boards, const std::string& hex) {
  const std::vector<std::uint8_t> flash = boards.device.Flash();
  const std::vector<std::uint8_t> wanted = torquer::tools::ReadHexFile(hex);
  CHECK(std::equal(wanted.begin(), wanted.end(), flash.begin()));
}

}  // namespace

TEST_CASE("the first firmware comes onto a board that has the bootloader alone") {
  BenchOptions options;
  options.serial = "FIRST-1";
  for (const std::string suffix : {"", "-8mhz", "-16to8mhz", "-two-sensors"}) {
    EmulatedBoards boards(Bootloader(suffix), options);
    CHECK(boards.Start() == BoardMode::kBootloader);
    const auto outcome =
        boards.Flash(torquer::test::FirmwarePath("torquer-firmware" + suffix + ".hex"));
    REQUIRE(outcome);
    CHECK_THAT(boards.said, Contains("FIRST-1") && Contains("without a valid application"));
    CHECK(outcome->version == kOldVersion);
    CHECK(outcome->serial == "FIRST-1");
    CHECK(outcome->application_good);
    CHECK(outcome->settings_good);
    CHECK(outcome->sensor_good);
    CHECK(outcome->second_sensor_good ==
          (suffix == "-two-sensors" ? std::optional(true) : std::nullopt));
    boards.device.PowerOff();
    CHECK(boards.Start() == BoardMode::kFirmware);
    boards.CheckRules();
  }
}

TEST_CASE("running firmware enters the bootloader on request and is replaced") {
  EmulatedBoards boards(WithApplication());
  CHECK(boards.Start() == BoardMode::kFirmware);
  const auto outcome = boards.Flash(kNewHex);
  REQUIRE(outcome);
  CHECK_THAT(boards.said, Contains("running firmware 0.1.0"));
  CHECK(outcome->version == kNewVersion);
  CHECK(outcome->application_good);
  CheckInstalled(boards, kNewHex);
  boards.CheckRules();

  SECTION("an older one is refused without effect") {
    const std::string refusal = MessageOf<UserError>([&] { boards.Flash(kOldHex); });
    CHECK_THAT(refusal, Contains("0.15.2 is installed") && Contains("--force"));
    CHECK(boards.Mode() == BoardMode::kFirmware);
    CheckInstalled(boards, kNewHex);
  }
  SECTION("an older one is forced") {
    FlashRequest request;
    request.force = true;
    CHECK(boards.Flash(kOldHex, request)->version == kOldVersion);
  }
  SECTION("the same is written again") { CHECK(boards.Flash(kNewHex)->version == kNewVersion); }
}

TEST_CASE("an image for another clock is refused, forced or not") {
  EmulatedBoards boards(WithApplication());
  BoardMode mode = boards.Start();
  SECTION("by the running firmware's word") {}
  SECTION("by the bootloader's") {
    mode = boards.ResetByPin();
    CHECK(mode == BoardMode::kBootloader);
  }
  FlashRequest request;
  request.force = true;
  const std::string refusal = MessageOf<UserError>([&] { boards.Flash(kSlowHex, request); });
  CHECK_THAT(refusal, Contains("8 MHz") && Contains("16 MHz"));
  CHECK(boards.Mode() == mode);
  CheckInstalled(boards, kOldHex);
}

TEST_CASE("an image for another board is refused, forced or not") {
  const std::string two = torquer::test::FirmwarePath("torquer-firmware-two-sensors.hex");
  EmulatedBoards boards(WithApplication());
  BoardMode mode = boards.Start();
  SECTION("by the running firmware's word") {}
  SECTION("by the bootloader's") { mode = boards.ResetByPin(); }
  FlashRequest request;
  request.force = true;
  CHECK_THAT(MessageOf<UserError>([&] { boards.Flash(two, request); }),
             Contains("is for board 2 (two sensors)") && Contains("this is board 1 (one sensor)") &&
                 Contains("Nothing was changed") && Contains("install the other bootloader"));
  CHECK(boards.Mode() == mode);
  CHECK(boards.device.page_operations() == 0);
}

TEST_CASE("a bootloader of another board than the firmware's is seen before a page is written") {
  EmulatedBoards boards(
      FirmwareImage::Load(torquer::test::FirmwarePath("torquer-firmware-two-sensors.elf"),
                          torquer::test::FirmwarePath("torquer-bootloader.elf")));
  // Our bootloader does not start the image of another board.
  CHECK(boards.Start() == BoardMode::kBootloader);
  CHECK_THAT(MessageOf<UserError>([&] {
               boards.Flash(torquer::test::FirmwarePath("torquer-firmware-two-sensors.hex"));
             }),
             Contains("this is board 1 (one sensor)"));
  CHECK(boards.device.page_operations() == 0);
  CHECK(boards.Flash(kOldHex)->version == kOldVersion);
}

TEST_CASE("a dry run lists the steps and does not change the board") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  FlashRequest request;
  request.dry_run = true;
  CHECK_FALSE(boards.Flash(kNewHex, request));
  CHECK_THAT(boards.said, Contains("would write firmware 0.15.2"));
  CHECK(boards.Mode() == BoardMode::kFirmware);
  CHECK(boards.device.chip().resets() == 0);
  CHECK(boards.device.page_operations() == 0);
}

TEST_CASE("without an image named, that for the board and its clock is taken") {
  for (const std::string suffix :
       {"-8mhz", "-16to8mhz", "-two-sensors", "-two-sensors-8mhz", "-two-sensors-16to8mhz"}) {
    EmulatedBoards boards(WithApplication(suffix));
    boards.Start();
    FlashRequest request;
    request.image_folder = torquer::test::FirmwarePath("");
    CHECK(boards.Flash("", request)->version == kOldVersion);
    CheckInstalled(boards, torquer::test::FirmwarePath("torquer-firmware" + suffix + ".hex"));
    boards.CheckRules();
  }
}

TEST_CASE("an image for another CPU clock is refused before a page is written") {
  const std::string half = torquer::test::FirmwarePath("torquer-firmware-16to8mhz.hex");
  EmulatedBoards boards(WithApplication());
  SECTION("the firmware runs") {
    CHECK(boards.Start() == BoardMode::kFirmware);
    CHECK_THAT(
        MessageOf<torquer::UserError>([&] { boards.Flash(half); }),
        Contains("CPU of 8 MHz") && Contains("is for 16 MHz") && Contains("Nothing was changed"));
    boards.Sleep(50);
    CHECK(boards.Mode() == BoardMode::kFirmware);
  }
  SECTION("the bootloader waits") {
    boards.Start();
    CHECK(boards.ResetByPin() == BoardMode::kBootloader);
    CHECK_THAT(MessageOf<torquer::UserError>([&] { boards.Flash(half); }),
               Contains("CPU of 8 MHz") && Contains("is for 16 MHz"));
  }
  CHECK(boards.device.page_operations() == 0);
}

TEST_CASE("a supply too low for 16 MHz is reported, with the image that suits it") {
  for (const int supply_mv : {3300, 4400, 5000}) {
    BenchOptions options;
    options.supply_mv = supply_mv;
    EmulatedBoards boards(Bootloader(), options);
    boards.Start();
    const std::string warning = boards.Flash(kOldHex)->supply_warning;
    CAPTURE(supply_mv, warning);
    CHECK(warning.empty() == (supply_mv > 4000));
    if (!warning.empty()) CHECK_THAT(warning, Contains("3.3 V") && Contains("-16to8mhz.hex"));
  }
}

TEST_CASE("an interruption reports the board's state, and the next run finishes") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  int pages = 0;
  boards.stop = [&] { return ++pages > 20; };
  CHECK_THAT(MessageOf<FlashUnfinished>([&] { boards.Flash(kNewHex); }),
             Contains("no valid application") && Contains("Run the same command again"));
  boards.stop = [] { return false; };
  boards.said.clear();
  CHECK(boards.Flash(kNewHex)->version == kNewVersion);
  CHECK_THAT(boards.said, Contains("an update was interrupted"));
}

TEST_CASE("a page that reads back otherwise is reported, and not made valid") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  boards.spoiled_address = 0x0480;
  CHECK_THAT(MessageOf<FlashUnfinished>([&] { boards.Flash(kNewHex); }),
             Contains("page 10 does not read back") && Contains("no valid application"));
  boards.device.PowerOff();
  CHECK(boards.Start() == BoardMode::kBootloader);
}

TEST_CASE("a board without any bootloader is distinguished from one that is slow") {
  EmulatedBoards boards(
      torquer::emulator::FirmwareImage(torquer::test::FirmwarePath("torquer-firmware.elf")));
  boards.Start();
  CHECK_THAT(MessageOf<FlashUnfinished>([&] { boards.Flash(kNewHex); }),
             Contains("has no bootloader") && Contains("Nothing was written"));
  CHECK(boards.Mode() == BoardMode::kFirmware);
}

TEST_CASE("another board's serial number is refused") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  FlashRequest request;
  request.device = "ELSE-1";
  CHECK_THAT(MessageOf<UserError>([&] { boards.Flash(kNewHex, request); }),
             Contains("ELSE-1") && Contains(boards.List().front().serial));
}

TEST_CASE("an application whose CRC is wrong is not started") {
  torquer::emulator::FirmwareImage image = WithApplication();
  std::vector<std::uint8_t> flash = image.flash();
  SECTION("a bit of the application") { flash[0x1234] ^= 0x10; }
  SECTION("a bit of the trailer") { flash[protocol::kImageTrailerAddress + 9] ^= 0x01; }
  SECTION("a trailer without a length") {
    flash[protocol::kImageTrailerAddress + 4] = flash[protocol::kImageTrailerAddress + 5] = 0;
  }
  SECTION("one longer than the flash that there is for it") {
    flash[protocol::kImageTrailerAddress + 5] = 0x70;
  }
  image.SetFlash(flash);
  EmulatedBoards boards(image);
  CHECK(boards.Start() == BoardMode::kBootloader);
  CHECK(boards.Flash(kOldHex)->application_good);
}

TEST_CASE("without a bootloader's check the firmware itself reports that it is damaged") {
  // State of a board that keeps Caterina.
  torquer::emulator::FirmwareImage image(torquer::test::FirmwarePath("torquer-firmware.elf"));
  EmulatedBoards good(image);
  good.Start();
  const auto self_test = [](EmulatedBoards& boards) {
    const ControlResult result = boards.host.GetFeature(protocol::kIdentityReportId);
    protocol::IdentityReport identity;
    std::memcpy(&identity, result.data.data(), sizeof(identity));
    return identity.self_test;
  };
  CHECK((self_test(good) & 1) == 1);
  std::vector<std::uint8_t> flash = image.flash();
  flash[protocol::kImageTrailerAddress - 1] = 0xfe;  // unused byte, outside the image
  image.SetFlash(flash);
  EmulatedBoards still_good(image);
  still_good.Start();
  CHECK((self_test(still_good) & 1) == 1);
  flash[protocol::kImageTrailerAddress + 12] ^= 1;
  image.SetFlash(flash);
  EmulatedBoards damaged(image);
  damaged.Start();
  CHECK((self_test(damaged) & 1) == 0);
}
