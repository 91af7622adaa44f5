// Board selection of torquer-flash, and its messages for boards that it cannot serve by itself.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cstring>

#include "host/tools/flash_procedure.h"
#include "protocol/hid_reports.h"
#include "tests/support/paths.h"

namespace {

using namespace torquer::tools;
using Catch::Contains;
using torquer::UserError;
namespace protocol = torquer::protocol;

const std::string kChosenHex = torquer::test::FirmwarePath("torquer-firmware.hex");

// Firmware that only answers identity requests.
class IdentityLink final : public FeatureLink {
 public:
  explicit IdentityLink(std::string serial) : serial_(std::move(serial)) {}
  std::vector<std::uint8_t> Get(std::uint8_t, std::size_t size) override {
    protocol::IdentityReport identity{};
    identity.report_id = protocol::kIdentityReportId;
    identity.protocol_version = protocol::kProtocolVersion;
    identity.firmware_minor = 1;
    identity.crystal_mhz = 16;
    std::memcpy(identity.serial, serial_.data(), serial_.size());
    identity.self_test = 7;
    std::vector<std::uint8_t> bytes(size);
    std::memcpy(bytes.data(), &identity, sizeof(identity));
    return bytes;
  }
  void Set(std::span<const std::uint8_t>) override { throw ReportRefused("stall"); }

 private:
  std::string serial_;
};

struct FakeBoards final : Boards {
  std::vector<Board> List() override { return boards; }
  std::unique_ptr<FeatureLink> Open(const Board& board) override {
    return std::make_unique<IdentityLink>(board.serial);
  }
  void Sleep(int milliseconds) override { slept_ms += milliseconds; }

  void Add(BoardMode mode, const std::string& place, const std::string& serial = "") {
    Board board;
    board.mode = mode;
    board.place = place;
    board.serial = serial;
    if (mode == BoardMode::kCaterina) board.port = "/dev/ttyACM7";
    if (mode == BoardMode::kCaterina) board.crystal_mhz = 16;
    boards.push_back(board);
  }
  std::optional<FlashOutcome> Flash(FlashRequest request = {}, const FlashHooks& hooks = {}) {
    if (request.image.empty()) request.image = kChosenHex;
    return FlashProcedure(*this, request, hooks).Run();
  }
  std::string Refusal(const FlashRequest& request = {}) {
    try {
      Flash(request);
    } catch (const UserError& error) {
      return error.what();
    }
    return "taken";
  }

  std::vector<Board> boards;
  int slept_ms = 0;
};

}  // namespace

TEST_CASE("without a board, or with one that must be reset first, the user gets the remedy") {
  FakeBoards boards;
  SECTION("none") { CHECK_THAT(boards.Refusal(), Contains("no board found")); }
  SECTION("an Arduino program") {
    boards.Add(BoardMode::kSketch, "1-4");
    CHECK_THAT(boards.Refusal(), Contains("USB 1-4") && Contains("Reset it") && Contains("8 s"));
  }
  SECTION("the factory's bootloader") {
    boards.Add(BoardMode::kDfu, "1-4");
    CHECK_THAT(boards.Refusal(), Contains("DFU") && Contains("dfu-programmer atmega32u4 reset"));
  }
  SECTION("one that may not be opened, after a moment for the permission to come") {
    boards.Add(BoardMode::kFirmware, "1-4");
    boards.boards.front().problem = "it may not be opened";
    CHECK_THAT(boards.Refusal(), Contains("USB 1-4: it may not be opened"));
    CHECK(boards.slept_ms >= 1000);
  }
}

TEST_CASE("one of several boards has to be chosen") {
  FakeBoards boards;
  boards.Add(BoardMode::kFirmware, "1-1", "A-1");
  boards.Add(BoardMode::kFirmware, "1-2", "B-2");
  CHECK_THAT(boards.Refusal(),
             Contains("A-1 at USB 1-1") && Contains("B-2 at USB 1-2") && Contains("--device"));
  FlashRequest request;
  request.device = "C-3";
  CHECK_THAT(boards.Refusal(request), Contains("C-3") && Contains("A-1 B-2"));
  request.device = "B-2";
  CHECK_THAT(boards.Refusal(request), Contains("B-2: the firmware refuses to enter"));
  // With a serial number given, a foreign Arduino beside the board is ignored.
  boards.Add(BoardMode::kSketch, "1-3");
  CHECK_THAT(boards.Refusal(request), Contains("B-2: the firmware refuses to enter"));
}

TEST_CASE("a board in Caterina is written at its port, and its firmware is heard afterwards") {
  FakeBoards boards;
  std::string port;
  FlashHooks hooks;
  hooks.flash_caterina = [&](const std::string& at, const FlashImage& image) {
    port = at;
    CHECK(image.version().minor == 1);
    boards.boards.clear();
    boards.Add(BoardMode::kFirmware, "1-9", "NOT-IT");
    boards.Add(BoardMode::kFirmware, "1-4", "NEW-1");
  };
  FlashRequest request;
  SECTION("found by itself, and known by its plug") {
    boards.Add(BoardMode::kCaterina, "1-4");
    const auto outcome = boards.Flash(request, hooks);
    REQUIRE(outcome);
    CHECK(outcome->serial == "NEW-1");
    CHECK(port == "/dev/ttyACM7");
  }
  SECTION("named") {
    request.port = "/dev/pts/9";
    CHECK(boards.Flash(request, hooks));
    CHECK(port == "/dev/pts/9");
  }
  SECTION("with an image for another clock it is left alone") {
    boards.Add(BoardMode::kCaterina, "1-4");
    request.image = torquer::test::FirmwarePath("torquer-firmware-8mhz.hex");
    CHECK_THROWS_WITH(boards.Flash(request, hooks), Contains("16 MHz"));
    CHECK(port.empty());
  }
}

TEST_CASE(
    "a board that runs an Arduino program is overwritten where its port is named, and only then") {
  FakeBoards boards;
  boards.Add(BoardMode::kSketch, "1-4");
  boards.boards.front().port = "/dev/ttyACM3";
  boards.boards.front().crystal_mhz = 16;
  std::vector<std::string> log;
  FlashHooks hooks;
  hooks.say = [&](const std::string& line) { log.push_back(line); };
  hooks.ask_sketch = [&](const std::string& port) {
    log.push_back("asked " + port);
    boards.boards.clear();
    boards.Add(BoardMode::kCaterina, "1-5");  // a foreign board
    boards.Add(BoardMode::kCaterina, "1-4");
    boards.boards.back().port = "/dev/ttyACM4";
  };
  hooks.flash_caterina = [&](const std::string& port, const FlashImage&) {
    log.push_back("written " + port);
    boards.boards.clear();
    boards.Add(BoardMode::kFirmware, "1-4", "NEW-1");
  };
  FlashRequest request;
  SECTION("not named") {
    CHECK_THROWS_WITH(boards.Flash(request, hooks),
                      Contains("runs an Arduino program") && Contains("--port /dev/ttyACM3"));
    request.port = "/dev/ttyACM9";  // not the port of the Arduino program
    boards.Flash(request, hooks);
    CHECK(log.back() == "waiting for the new firmware");
    CHECK(std::count(log.begin(), log.end(), "asked /dev/ttyACM3") == 0);
  }
  request.port = "/dev/ttyACM3";
  SECTION("named") {
    const auto outcome = boards.Flash(request, hooks);
    REQUIRE(outcome);
    CHECK(outcome->serial == "NEW-1");
    CHECK_THAT(log.front(), Contains("which runs an Arduino program"));
    CHECK(std::count(log.begin(), log.end(), "asked /dev/ttyACM3") == 1);
    CHECK(std::count(log.begin(), log.end(), "written /dev/ttyACM4") == 1);
  }
  SECTION("a dry run asks no question") {
    request.dry_run = true;
    CHECK_FALSE(boards.Flash(request, hooks));
    CHECK(std::count(log.begin(), log.end(), "asked /dev/ttyACM3") == 0);
  }
  SECTION("its bootloader does not come") {
    hooks.ask_sketch = [](const std::string&) {};
    CHECK_THROWS_WITH(boards.Flash(request, hooks),
                      Contains("Nothing was written") && Contains("twice within a second"));
  }
  SECTION("an image for another clock is refused before any question") {
    request.image = torquer::test::FirmwarePath("torquer-firmware-8mhz.hex");
    CHECK_THROWS_WITH(boards.Flash(request, hooks), Contains("16 MHz"));
    CHECK(log.size() == 1);
  }
}

TEST_CASE("firmware of another version than was written is not taken for it") {
  FakeBoards boards;
  boards.Add(BoardMode::kCaterina, "1-4");
  FlashHooks hooks;
  hooks.flash_caterina = [&](const std::string&, const FlashImage&) {
    boards.boards.clear();
    boards.Add(BoardMode::kFirmware, "1-4", "OLD-1");
  };
  FlashRequest request;
  request.image = TORQUER_NEXT_FIRMWARE_DIR "/torquer-firmware-next.hex";
  CHECK_THROWS_WITH(boards.Flash(request, hooks),
                    Contains("firmware 0.1.0 answers") && Contains("0.15.2 was written"));
}
