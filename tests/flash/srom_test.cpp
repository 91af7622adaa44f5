// torquer-flash --srom: choice of the board whose sensor gets the image, and messages if none does.
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "host/device/sensor_firmware.h"
#include "tests/flash/emulated_boards.h"
#include "tests/support/emulated_bench.h"
#include "tests/support/temporary_folder.h"

namespace torquer::test {
namespace {

using Catch::Contains;
using emulator::TestSrom;
using tools::FlashHooks;
using tools::FlashProcedure;
using tools::FlashRequest;

struct ImageFile {
  explicit ImageFile(std::vector<std::uint8_t> bytes = TestSrom()) : path(folder.Path("srom.bin")) {
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
  }
  TemporaryFolder folder;
  std::string path;
};

int Load(EmulatedBoards& boards, const std::string& path, const FlashRequest& request = {}) {
  FlashHooks hooks;
  hooks.say = [&](const std::string& line) { boards.said += line + "\n"; };
  return FlashProcedure(boards, request, hooks).LoadSensorImage(path);
}

TEST_CASE("the sensor's image is loaded from a file into the sensor of the board") {
  const ImageFile file;
  EmulatedBoards boards(WithApplication());
  REQUIRE(boards.Start() == tools::BoardMode::kFirmware);  // its sensor starts in the meantime
  FlashRequest dry;
  dry.dry_run = true;
  CHECK(Load(boards, file.path, dry) == 0);
  CHECK(boards.device.sensor().srom().empty());
  CHECK_THAT(boards.said, Contains("running firmware") && Contains("nothing was done"));
  setenv("XDG_CONFIG_HOME", file.folder.Path("config").c_str(), 1);
  CHECK(Load(boards, file.path) == 5);
  unsetenv("XDG_CONFIG_HOME");
  CHECK(boards.device.sensor().srom() == TestSrom());
  // The tool keeps a copy for the daemon.
  std::vector<std::string> kept;
  for (const auto& entry :
       std::filesystem::directory_iterator(file.folder.Path("config/torquer"))) {
    kept.push_back(entry.path());
  }
  REQUIRE(kept.size() == 1);
  CHECK_THAT(boards.said, Contains("saved as " + kept[0] + "; torquer-daemon loads this copy"));
  CHECK(device::ReadSromFile(kept[0]) == TestSrom());
  boards.CheckRules();
}

TEST_CASE("an image for the sensor that cannot be loaded is refused with the remedy") {
  const ImageFile file;
  SECTION("the board is in its bootloader") {
    EmulatedBoards boards(Bootloader());
    REQUIRE(boards.Start() == tools::BoardMode::kBootloader);
    CHECK_THAT(MessageOf<UserError>([&] { Load(boards, file.path); }),
               Contains("run torquer-flash without options first"));
  }
  SECTION("the sensor does not answer") {
    EmulatedBoards boards(WithApplication());
    boards.Start();
    boards.device.sensor().SetFault(emulator::VirtualPmw3360::Fault::kSilent);
    boards.Sleep(500);
    CHECK_THAT(MessageOf<UserError>([&] { Load(boards, file.path); }),
               Contains("check its wiring"));
  }
  SECTION("the file is another") {
    const ImageFile other(std::vector<std::uint8_t>(100, 0x80));
    EmulatedBoards boards(WithApplication());
    boards.Start();
    CHECK_THAT(MessageOf<UserError>([&] { Load(boards, other.path); }),
               Contains("has 100 bytes") && Contains("srom.bin"));
    CHECK(boards.said.empty());  // checked before any board
  }
  SECTION("the cable is pulled") {
    EmulatedBoards boards(WithApplication());
    boards.Start();
    boards.Sleep(300);
    boards.device.PowerOff();
    boards.Sleep(1);
    CHECK_THAT(MessageOf<UserError>([&] { Load(boards, file.path); }), Contains("no board found"));
  }
}

TEST_CASE("contacts that are closed at rest are set on the board, which keeps them") {
  BenchOptions options;
  options.closed_at_rest = protocol::kButtonXray;
  EmulatedBoards boards(WithApplication(), options);
  REQUIRE(boards.Start() == tools::BoardMode::kFirmware);
  const auto set = [&boards](std::uint8_t buttons, bool dry_run) {
    FlashRequest request;
    request.dry_run = dry_run;
    FlashHooks hooks;
    hooks.say = [&](const std::string& line) { boards.said += line + "\n"; };
    FlashProcedure(boards, request, hooks).SetClosedAtRest(buttons);
  };
  const auto kept = [&boards] {
    return boards.host.GetFeature(protocol::kConfigurationReportId).data.at(6);
  };
  set(protocol::kButtonXray, true);
  CHECK_THAT(boards.said, Contains("nothing was done"));
  CHECK(kept() == 0);
  set(protocol::kButtonXray, false);
  CHECK(kept() == protocol::kButtonXray);
  boards.Sleep(200);
  boards.device.PowerOff();
  REQUIRE(boards.Start() == tools::BoardMode::kFirmware);
  CHECK(kept() == protocol::kButtonXray);
  CHECK_THAT(MessageOf<UserError>([&] { set(8, false); }),
             Contains("refuses the setting") && Contains("run torquer-flash"));
  CHECK(kept() == protocol::kButtonXray);
  boards.CheckRules();
}

}  // namespace
}  // namespace torquer::test
