// Emulated bench device, plugged into the procedure under test; time is virtual.
#pragma once

#include <catch2/catch.hpp>
#include <memory>
#include <string>
#include <vector>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"
#include "host/tools/flash_board.h"
#include "host/tools/flash_procedure.h"
#include "protocol/bootloader_reports.h"
#include "protocol/usb_ids.h"
#include "tests/support/paths.h"

namespace torquer::test {

using emulator::BenchDevice;
using emulator::BenchOptions;
using emulator::FirmwareImage;
using emulator::TransferStatus;
using emulator::UsbHost;

const std::string kOldHex = FirmwarePath("torquer-firmware.hex");
constexpr char kNewHex[] = TORQUER_NEXT_FIRMWARE_DIR "/torquer-firmware-next.hex";
const std::string kSlowHex = FirmwarePath("torquer-firmware-8mhz.hex");
inline const tools::FirmwareVersion kOldVersion = {0, 1, 0};
inline const tools::FirmwareVersion kNewVersion = {0, 15, 2};

inline FirmwareImage Bootloader(const std::string& suffix = "") {
  return FirmwareImage(FirmwarePath("torquer-bootloader" + suffix + ".elf"));
}
inline FirmwareImage WithApplication(const std::string& suffix = "") {
  return FirmwareImage::Load(FirmwarePath("torquer-firmware" + suffix + ".elf"),
                             FirmwarePath("torquer-bootloader" + suffix + ".elf"));
}

class EmulatedLink final : public tools::FeatureLink {
 public:
  EmulatedLink(UsbHost& host, int spoiled_address)
      : host_(host), spoiled_address_(spoiled_address) {}
  std::vector<std::uint8_t> Get(std::uint8_t id, std::size_t size) override {
    std::vector<std::uint8_t> report = Transfer(
        {0xa1, 1, static_cast<std::uint16_t>(0x300 | id), 0, static_cast<std::uint16_t>(size)}, {});
    if (id == protocol::kPageReportId && (report[2] | report[3] << 8) == spoiled_address_) {
      report[40] ^= 1;
    }
    return report;
  }
  void Set(std::span<const std::uint8_t> report) override {
    Transfer({0x21, 9, static_cast<std::uint16_t>(0x300 | report.front()), 0,
              static_cast<std::uint16_t>(report.size())},
             {report.begin(), report.end()});
  }

 private:
  std::vector<std::uint8_t> Transfer(const emulator::SetupPacket& setup,
                                     const std::vector<std::uint8_t>& data) {
    const emulator::ControlResult result = host_.Control(setup, data);
    if (result.status == TransferStatus::kStall) throw tools::ReportRefused("stall");
    if (result.status != TransferStatus::kDone) throw tools::BoardLost("gone");
    return result.data;
  }

  UsbHost& host_;
  int spoiled_address_;
};

class EmulatedBoards final : public tools::Boards {
 public:
  explicit EmulatedBoards(const FirmwareImage& image, const BenchOptions& options = {})
      : device(image, options), host(device) {}

  std::vector<tools::Board> List() override {
    if (!host.ready()) return {};
    const emulator::Enumeration& found = host.enumeration();
    tools::Board board;
    board.place = "1-1";
    board.serial = found.serial;
    board.mode = (found.device_descriptor[10] | found.device_descriptor[11] << 8) ==
                         protocol::kUsbBootloaderProductId
                     ? tools::BoardMode::kBootloader
                     : tools::BoardMode::kFirmware;
    return {board};
  }
  std::unique_ptr<tools::FeatureLink> Open(const tools::Board&) override {
    return std::make_unique<EmulatedLink>(host, spoiled_address);
  }
  void Sleep(int milliseconds) override {
    for (int i = 0; i < milliseconds; ++i) host.RunFrame();
  }

  /// Powers the board on (again) and returns its mode.
  tools::BoardMode Start() {
    if (!device.powered()) Sleep(1);  // the host detects the disconnect
    device.PowerOn();
    return Mode();
  }
  tools::BoardMode ResetByPin() {
    device.ResetByPin();
    Sleep(2);  // it is off the bus
    return Mode();
  }
  /// Mode of the program that runs on the board, once it is on the bus.
  tools::BoardMode Mode() {
    REQUIRE(host.RunUntilReady());
    return List().front().mode;
  }

  /// Same as `torquer-flash IMAGE`.
  std::optional<tools::FlashOutcome> Flash(const std::string& image,
                                           tools::FlashRequest request = {}) {
    request.image = image;
    tools::FlashHooks hooks;
    hooks.say = [this](const std::string& line) { said += line + "\n"; };
    hooks.stop = stop;
    return tools::FlashProcedure(*this, request, hooks).Run();
  }

  /// Checks that no rule of the chip was violated.
  void CheckRules() {
    for (const std::string& violation : device.Violations()) FAIL_CHECK(violation);
  }

  BenchDevice device;
  UsbHost host;
  std::string said;
  int spoiled_address = -1;  ///< this page reads back with a wrong bit
  std::function<bool()> stop = [] { return false; };
};

/// Message of the Error that `action` throws.
template <typename Error, typename Action>
std::string MessageOf(Action action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  FAIL("nothing was thrown");
  return {};
}

}  // namespace torquer::test
