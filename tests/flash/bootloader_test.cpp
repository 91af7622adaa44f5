// Bootloader alone: its size, the programs that it starts and when, and the requests that it
// refuses.
#include <catch2/catch.hpp>
#include <cstring>
#include <random>

#include "protocol/bootloader_reports.h"
#include "protocol/serial_number.h"
#include "tests/flash/emulated_boards.h"

namespace {

using torquer::emulator::BenchOptions;
using torquer::emulator::ControlResult;
using torquer::emulator::SetupPacket;
using torquer::test::Bootloader;
using torquer::test::EmulatedBoards;
using torquer::test::FirmwareImage;
using torquer::test::kNewHex;
using torquer::test::kOldHex;
using torquer::test::TransferStatus;
using torquer::test::WithApplication;
using torquer::tools::BoardMode;
using torquer::tools::FlashImage;
namespace protocol = torquer::protocol;

constexpr std::size_t kPageBytes = protocol::kFlashPageBytes;

template <typename Report>
TransferStatus Set(EmulatedBoards& boards, const Report& report) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(&report);
  return boards.host.SetFeature({bytes, bytes + sizeof(report)}).status;
}

template <typename Report>
Report Get(EmulatedBoards& boards, std::uint8_t id) {
  const ControlResult result =
      boards.host.Control({0xa1, 1, static_cast<std::uint16_t>(0x300 | id), 0, sizeof(Report)});
  REQUIRE(result.status == TransferStatus::kDone);
  REQUIRE(result.data.size() == sizeof(Report));
  Report report;
  std::memcpy(&report, result.data.data(), sizeof(report));
  return report;
}

protocol::BootloaderStatusReport Status(EmulatedBoards& boards) {
  return Get<protocol::BootloaderStatusReport>(boards, protocol::kBootloaderStatusReportId);
}

protocol::DiagnosticsReport Diagnostics(EmulatedBoards& boards) {
  return Get<protocol::DiagnosticsReport>(boards, protocol::kDiagnosticsReportId);
}

protocol::PageReport PageOf(const FlashImage& image, int index) {
  protocol::PageReport report{protocol::kPageReportId, 0, image.PageAddress(index), {}};
  const std::vector<std::uint8_t> page = image.Page(index);
  std::copy(page.begin(), page.end(), report.data);
  return report;
}

TransferStatus Command(EmulatedBoards& boards, int command, std::uint16_t address = 0,
                       std::uint16_t key = protocol::kCommandKey) {
  return Set(boards, protocol::BootloaderCommandReport{protocol::kBootloaderCommandReportId,
                                                       static_cast<std::uint8_t>(command),
                                                       key,
                                                       address,
                                                       {}});
}

TransferStatus FirmwareCommand(EmulatedBoards& boards, protocol::Command command) {
  return Set(boards, protocol::CommandReport{
                         protocol::kCommandReportId, command, protocol::kCommandKey, {}});
}

}  // namespace

TEST_CASE("the bootloader fits its section, for both clocks, with room for a repair") {
  constexpr std::size_t kLimit = 2000;  // of 2048 bytes
  for (const std::string suffix : {"", "-8mhz", "-16to8mhz"}) {
    const FirmwareImage image = Bootloader(suffix);
    CHECK(image.boot_start() == protocol::kBootloaderAddress);
    const std::size_t bytes = image.flash().size() - protocol::kBootloaderAddress;
    CAPTURE(suffix);
    CHECK(bytes <= kLimit);
    CHECK(image.flash().size() <= protocol::kBootloaderAddress + protocol::kBootloaderBytes);
    // The bootloader has no variables: they would overwrite those that the application keeps over a
    // reset.
    CHECK_FALSE(image.HasSymbol("__do_copy_data"));
    CHECK_FALSE(image.HasSymbol("__do_clear_bss"));
  }
}

TEST_CASE("the bootloader starts a program according to the cause of the reset") {
  EmulatedBoards boards(WithApplication());
  CHECK(boards.Start() == BoardMode::kFirmware);
  CHECK(Diagnostics(boards).reset_reason == 1);

  SECTION("the reset pin is for getting in") {
    CHECK(boards.ResetByPin() == BoardMode::kBootloader);
    CHECK(Status(boards).application_valid == 1);
    SECTION("and a restart out again") {
      CHECK(Command(boards, protocol::kBootloaderRestart) == TransferStatus::kDone);
      boards.Sleep(50);
      CHECK(boards.Mode() == BoardMode::kFirmware);
    }
    SECTION("as is the power") {
      boards.device.PowerOff();
      CHECK(boards.Start() == BoardMode::kFirmware);
    }
  }
  SECTION("a watchdog reset starts the firmware, which reads its cause") {
    const int boot_id = boards.device.chip().resets();
    CHECK(FirmwareCommand(boards, protocol::kCommandReset) == TransferStatus::kDone);
    boards.Sleep(50);
    CHECK(boards.Mode() == BoardMode::kFirmware);
    CHECK(boards.device.chip().resets() == boot_id + 1);
    CHECK(Diagnostics(boards).reset_reason == 8);
  }
  SECTION("unless the firmware has left the key") {
    CHECK(FirmwareCommand(boards, protocol::kCommandEnterBootloader) == TransferStatus::kDone);
    boards.Sleep(50);
    CHECK(boards.Mode() == BoardMode::kBootloader);
    // The key is valid only once.
    CHECK(Command(boards, protocol::kBootloaderRestart) == TransferStatus::kDone);
    boards.Sleep(50);
    CHECK(boards.Mode() == BoardMode::kFirmware);
  }
  SECTION("a brown-out starts it") {
    boards.device.chip().ResetByBrownOut();
    boards.Sleep(2);
    CHECK(boards.Mode() == BoardMode::kFirmware);
    CHECK(Diagnostics(boards).reset_reason == 4);
  }
  boards.CheckRules();
}

TEST_CASE("a button held while the device is plugged in does not start the bootloader") {
  for (const std::uint8_t held :
       {protocol::kButtonXray, protocol::kButtonContrast, protocol::kButtonClutch}) {
    EmulatedBoards boards(WithApplication());
    boards.device.PowerOff();
    boards.device.SetHand([held](double) {
      torquer::emulator::HandState hand;
      hand.buttons = held;
      return hand;
    });
    CAPTURE(int{held});
    CHECK(boards.Start() == BoardMode::kFirmware);
    CHECK(FirmwareCommand(boards, protocol::kCommandReset) == TransferStatus::kDone);
    boards.Sleep(50);
    CHECK(boards.Mode() == BoardMode::kFirmware);
  }
}

TEST_CASE("the bootloader answers the standard requests of USB 2.0, chapter 9") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  REQUIRE(boards.ResetByPin() == BoardMode::kBootloader);
  using Bytes = std::vector<std::uint8_t>;
  const auto ask = [&](const SetupPacket& setup) { return boards.host.Control(setup); };
  const auto answers = [&](const SetupPacket& setup, const Bytes& data) {
    CAPTURE(int{setup.type}, int{setup.request}, setup.value, setup.index);
    const ControlResult result = ask(setup);
    CHECK(result.status == TransferStatus::kDone);
    CHECK(result.data == data);
  };
  const auto stalls = [&](const SetupPacket& setup) {
    CAPTURE(int{setup.type}, int{setup.request}, setup.value, setup.index);
    CHECK(ask(setup).status == TransferStatus::kStall);
  };
  answers({0x80, 0, 0, 0, 2}, {0, 0});  // GET_STATUS: device, interface, endpoints
  answers({0x81, 0, 0, 0, 2}, {0, 0});
  answers({0x82, 0, 0, 0x00, 2}, {0, 0});
  answers({0x82, 0, 0, 0x81, 2}, {0, 0});
  stalls({0x82, 0, 0, 0x82, 2});
  answers({0x02, 3, 0, 0x81, 0}, {});  // SET_FEATURE, CLEAR_FEATURE: ENDPOINT_HALT
  answers({0x82, 0, 0, 0x81, 2}, {1, 0});
  answers({0x02, 1, 0, 0x81, 0}, {});
  answers({0x82, 0, 0, 0x81, 2}, {0, 0});
  answers({0x02, 3, 0, 0x00, 0}, {});
  answers({0x82, 0, 0, 0x00, 2}, {0, 0});
  stalls({0x02, 3, 0, 0x02, 0});
  stalls({0x02, 3, 1, 0x81, 0});     // no such feature
  stalls({0x00, 3, 1, 0, 0});        // DEVICE_REMOTE_WAKEUP: it cannot
  stalls({0x00, 3, 2, 0x100, 0});    // TEST_MODE is for high speed
  answers({0x80, 8, 0, 0, 1}, {1});  // GET_CONFIGURATION, SET_CONFIGURATION
  stalls({0x00, 9, 2, 0, 0});
  answers({0x80, 8, 0, 0, 1}, {1});
  answers({0x81, 10, 0, 0, 1}, {0});  // GET_INTERFACE, SET_INTERFACE
  answers({0x01, 11, 0, 0, 0}, {});
  stalls({0x01, 11, 1, 0, 0});
  answers({0x00, 9, 0, 0, 0}, {});
  answers({0x80, 8, 0, 0, 1}, {0});
  stalls({0x81, 10, 0, 0, 1});
  stalls({0x82, 0, 0, 0x81, 2});
  answers({0x00, 9, 1, 0, 0}, {});
  answers({0x82, 0, 0, 0x81, 2}, {0, 0});
  stalls({0x80, 6, 0x0600, 0, 10});  // DEVICE_QUALIFIER is for high speed
  stalls({0x00, 7, 0x0100, 0, 0});   // SET_DESCRIPTOR is optional
  stalls({0x82, 12, 0, 0x81, 2});    // SYNCH_FRAME is for isochronous endpoints
  stalls({0xc0, 0x55, 0, 0, 8});
  // A bus reset ends the configuration.
  boards.host.ResetPort();
  REQUIRE(boards.host.RunUntilReady());
  answers({0x80, 8, 0, 0, 1}, {1});
  CHECK(Status(boards).application_valid == 1);
  boards.CheckRules();
}

TEST_CASE("data that the firmware keeps over a reset passes through the bootloader") {
  // boot_id counts the resets since power-on, in memory that a reset preserves.
  EmulatedBoards boards(WithApplication());
  boards.host.wants_input = [] { return true; };
  protocol::InputReport newest{};
  boards.host.on_input = [&](const std::vector<std::uint8_t>& packet) {
    REQUIRE(packet.size() == sizeof(newest));
    std::memcpy(&newest, packet.data(), sizeof(newest));
  };
  boards.Start();
  boards.Sleep(5);
  const std::uint8_t first = newest.boot_id;
  FirmwareCommand(boards, protocol::kCommandReset);
  boards.Sleep(50);
  boards.Mode();
  boards.Sleep(5);
  CHECK(newest.boot_id == first + 1);
  FirmwareCommand(boards, protocol::kCommandEnterBootloader);
  boards.Sleep(50);
  CHECK(boards.Mode() == BoardMode::kBootloader);
  CHECK(Command(boards, protocol::kBootloaderRestart) == TransferStatus::kDone);
  boards.Sleep(50);
  boards.Mode();
  boards.Sleep(5);
  CHECK(newest.boot_id == first + 2);
}

TEST_CASE("the bootloader reports its identity and the state of the application") {
  BenchOptions options;
  SECTION("with a number given") { options.serial = "STATUS-1"; }
  SECTION("with the chip's own") {}
  EmulatedBoards boards(WithApplication(), options);
  boards.Start();
  const std::string serial = boards.host.enumeration().serial;
  REQUIRE(boards.ResetByPin() == BoardMode::kBootloader);
  CHECK(boards.host.enumeration().product == protocol::kUsbBootloaderProduct);
  CHECK(boards.host.enumeration().manufacturer == protocol::kUsbManufacturer);
  CHECK(boards.host.enumeration().report_descriptor ==
        std::vector<std::uint8_t>(std::begin(protocol::kBootloaderReportDescriptor),
                                  std::end(protocol::kBootloaderReportDescriptor)));
  const auto status = Status(boards);
  CHECK(status.protocol_version == protocol::kBootloaderProtocolVersion);
  CHECK(status.board == protocol::kBoardBenchAtmega32u4);
  CHECK(status.clock == 16);
  CHECK(status.application_valid == 1);
  CHECK(status.trailer.crc == FlashImage::FromFile(kOldHex).trailer().crc);
  char made[protocol::kSerialBytes + 1] = {};
  protocol::MakeSerialNumber(status.given_serial, status.chip_serial, made);
  CHECK(made == serial);
  boards.CheckRules();
}

TEST_CASE("the bootloader refuses what could spoil it or start a wrong application") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  REQUIRE(boards.ResetByPin() == BoardMode::kBootloader);
  const FlashImage image = FlashImage::FromFile(kOldHex);
  const std::vector<std::uint8_t> before = boards.device.Flash();
  protocol::PageReport page = PageOf(image, 0);

  for (const int address :
       {0x0001, 0x0040, 0x6f81, 0x7000, 0x77ff, 0x7800, 0x7f80, 0x8000, 0xff80}) {
    page.address = static_cast<std::uint16_t>(address);
    CHECK(Set(boards, page) == TransferStatus::kStall);
  }
  page = PageOf(image, image.pages());
  page.data[12] ^= 1;  // its CRC
  CHECK(Set(boards, page) == TransferStatus::kStall);
  CHECK(Command(boards, 0) == TransferStatus::kStall);
  CHECK(Command(boards, 3) == TransferStatus::kStall);
  CHECK(Command(boards, protocol::kBootloaderRestart, 0, 0x1234) == TransferStatus::kStall);
  // Refused reports: too short, too long, of the firmware, or of unknown id.
  CHECK(boards.host.SetFeature(std::vector<std::uint8_t>(131, 17)).status ==
        TransferStatus::kStall);
  CHECK(boards.host.SetFeature(std::vector<std::uint8_t>(133, 17)).status ==
        TransferStatus::kStall);
  CHECK(FirmwareCommand(boards, protocol::kCommandEnterBootloader) == TransferStatus::kStall);
  CHECK(boards.host.GetFeature(protocol::kIdentityReportId).status == TransferStatus::kStall);
  CHECK(boards.device.Flash() == before);
  CHECK(boards.device.page_operations() == 0);
  CHECK(Status(boards).application_valid == 1);

  // A complete image for another crystal.
  const FlashImage slow = FlashImage::FromFile(torquer::test::kSlowHex);
  for (int i = 0; i < slow.pages(); ++i) {
    REQUIRE(Set(boards, PageOf(slow, i)) == TransferStatus::kDone);
  }
  CHECK(Status(boards).application_valid == 0);
  CHECK(Set(boards, PageOf(slow, slow.pages())) == TransferStatus::kStall);
  CHECK(Status(boards).application_valid == 0);
  boards.device.PowerOff();
  CHECK(boards.Start() == BoardMode::kBootloader);
  CHECK(boards.Flash(kOldHex)->application_good);
  boards.CheckRules();
}

TEST_CASE("all pages can be read back, the bootloader's included") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  REQUIRE(boards.ResetByPin() == BoardMode::kBootloader);
  const std::vector<std::uint8_t> flash = boards.device.Flash();
  for (const std::uint16_t from : {0x0000, 0x6f00, 0x7f00}) {
    REQUIRE(Command(boards, protocol::kBootloaderSelectPage, from) == TransferStatus::kDone);
    for (int i = 0; i < 2; ++i) {
      const auto page = Get<protocol::PageReport>(boards, protocol::kPageReportId);
      CHECK(page.address == from + i * kPageBytes);
      CHECK(std::equal(std::begin(page.data), std::end(page.data), flash.begin() + page.address));
    }
  }
}

TEST_CASE("no request, whole or aborted, wedges the bootloader or makes it write") {
  EmulatedBoards boards(WithApplication());
  boards.Start();
  REQUIRE(boards.ResetByPin() == BoardMode::kBootloader);
  std::mt19937 random(1);
  const auto any = [&](int limit) {
    return static_cast<int>(random() % static_cast<unsigned>(limit));
  };
  // Valid requests, about half of which are corrupted below.
  constexpr SetupPacket kServed[] = {
      {0x80, 6, 0x0100, 0, 18},  {0x80, 6, 0x0200, 0, 255}, {0x80, 6, 0x0300, 0, 255},
      {0x80, 6, 0x0302, 9, 64},  {0x81, 6, 0x2200, 0, 512}, {0x80, 0, 0, 0, 2},
      {0x00, 9, 1, 0, 0},        {0x21, 10, 0, 0, 0},       {0xa1, 1, 0x0310, 0, 52},
      {0xa1, 1, 0x0311, 0, 132}, {0x21, 9, 0x0312, 0, 8},   {0x21, 9, 0x0311, 0, 132}};
  int done = 0;
  for (int i = 0; i < 1500; ++i) {
    SetupPacket setup = kServed[any(static_cast<int>(std::size(kServed)))];
    switch (any(12)) {
      case 0:
        setup.type = static_cast<std::uint8_t>(any(256));
        break;
      case 1:
        setup.request = static_cast<std::uint8_t>(any(256));
        break;
      case 2:
        setup.value = static_cast<std::uint16_t>(any(65536));
        break;
      case 3:
        setup.index = static_cast<std::uint16_t>(any(65536));
        break;
      case 4:
      case 5:
        setup.length = static_cast<std::uint16_t>(any(300));
        break;
      default:
        break;
    }
    if (setup.type == 0 && setup.request == 5) continue;  // SET_ADDRESS would change the address
    std::vector<std::uint8_t> data;
    if (!(setup.type & 0x80)) {
      data.resize(setup.length);
      for (std::uint8_t& byte : data) byte = static_cast<std::uint8_t>(any(256));
      // Fewer bytes than announced: the host aborts.
      if (any(4) == 0 && !data.empty()) data.resize(static_cast<std::size_t>(any(setup.length)));
    }
    bool over = false;
    boards.host.Submit(setup, data, [&](const ControlResult& result) {
      over = true;
      done += result.status == TransferStatus::kDone;
    });
    for (int frame = 0; frame < 3 && !over; ++frame) boards.host.RunFrame();
    if (!over) boards.host.ResetPort();  // as a host finally does
    if (!boards.host.ready()) REQUIRE(boards.host.RunUntilReady());
  }
  CHECK(done > 100);
  CHECK(boards.device.page_operations() == 0);
  CHECK(boards.device.chip().resets() == 1);
  CHECK(Status(boards).application_valid == 1);
  CHECK(boards.Flash(kNewHex)->application_good);
  boards.CheckRules();
}
