// USB enumeration of the firmware as a host sees it: descriptors, requests, refusals.
#include <array>
#include <cstdlib>

#include "firmware/src/usb_descriptors.h"
#include "protocol/firmware_image.h"
#include "tests/support/emulated_bench.h"

namespace torquer::emulator {
namespace {

using Bytes = std::vector<std::uint8_t>;

TEST_CASE("the device enumerates with the descriptors of the protocol") {
  BenchOptions options;
  options.serial = "BENCH-0001";
  for (const FirmwareImage& image : {Image16(), Image8(), Image16To8()}) {
    Bench bench(options, image);
    REQUIRE(bench.host.RunUntilReady());
    const Enumeration& device = bench.host.enumeration();
    CHECK(device.device_descriptor ==
          Bytes(std::begin(firmware::kDeviceDescriptor), std::end(firmware::kDeviceDescriptor)));
    CHECK(device.configuration_descriptor == Bytes(std::begin(firmware::kConfigurationDescriptor),
                                                   std::end(firmware::kConfigurationDescriptor)));
    CHECK(device.report_descriptor == Bytes(std::begin(protocol::kHidReportDescriptor),
                                            std::end(protocol::kHidReportDescriptor)));
    CHECK(device.manufacturer == protocol::kUsbManufacturer);
    CHECK(device.product == protocol::kUsbProduct);
    CHECK(device.serial == "BENCH-0001");
    bench.CheckRules();
  }
}

TEST_CASE("vendor and product id are at their places in the descriptor") {
  Bench bench;
  REQUIRE(bench.host.RunUntilReady());
  const Bytes& descriptor = bench.host.enumeration().device_descriptor;
  CHECK((descriptor[8] | descriptor[9] << 8) == 0x1209);
  CHECK((descriptor[10] | descriptor[11] << 8) == 0x0001);
}

TEST_CASE("without a given serial number the chip's own makes one, and chips differ") {
  Bench first;
  BenchOptions options;
  options.seed = 2;
  Bench second(options);
  REQUIRE(first.host.RunUntilReady());
  REQUIRE(second.host.RunUntilReady());
  CHECK(first.host.enumeration().serial.substr(0, 3) == "TQ-");
  CHECK(first.host.enumeration().serial != second.host.enumeration().serial);
  const auto identity = first.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
  CHECK(std::string(identity.serial, 11) == first.host.enumeration().serial);
}

TEST_CASE("identity and diagnostics of a healthy device") {
  for (const FirmwareImage& image : {Image16(), Image8(), Image16To8()}) {
    Bench bench({}, image);
    bench.Start();
    bench.Run(1);
    const auto identity = bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId);
    CHECK(identity.protocol_version == protocol::kProtocolVersion);
    CHECK(identity.sensor_product_id == 0x42);
    CHECK(identity.sensor_revision == 0x01);
    CHECK(identity.crystal_mhz == image.crystal_hz() / 1000000);
    CHECK(identity.cpu_mhz == image.cpu_hz() / 1000000);
    CHECK(identity.board == protocol::kBoardBenchAtmega32u4);
    CHECK(identity.capabilities == 0x0f);
    const protocol::DiagnosticsReport diagnostics = bench.Diagnostics();
    CHECK(diagnostics.reset_reason == 1);
    CHECK(diagnostics.srom_id == 0);
    CHECK(diagnostics.sensor_faults == 0);
    CHECK(diagnostics.frames_missed == 0);
    CHECK(diagnostics.settings_writes == 0);
    CHECK(diagnostics.stack_headroom > 512);
    CHECK(diagnostics.stack_headroom < 2560);
    CHECK(diagnostics.longest_frame_us > 100);
    CHECK(diagnostics.longest_frame_us < 600);
  }
}

TEST_CASE("diagnostics report the supply of the chip") {
  for (const FirmwareImage& image : {Image16(), Image8(), Image16To8()}) {
    for (const int supply_mv : {2700, 3300, 4400, 5000, 5500}) {
      BenchOptions options;
      options.supply_mv = supply_mv;
      Bench bench(options, image);
      bench.device.SetHand([](double) {
        HandState hand;
        hand.joystick_x = 0.5;
        hand.joystick_y = -0.25;
        return hand;
      });
      bench.Start();
      CHECK(bench.Diagnostics().supply_mv == 0);
      bench.Run(0.3);
      CAPTURE(supply_mv);
      // One step of the converter is 5 mV at 2.7 V and 24 mV at 5.5 V.
      CHECK(std::abs(bench.Diagnostics().supply_mv - supply_mv) <= 45);
      // The measurement takes the place of one reading of each axis, and does not show in either.
      const protocol::InputReport before = bench.last;
      for (int frame = 0; frame < 600; ++frame) {
        bench.host.RunFrame();
        REQUIRE(bench.last.joystick_x == before.joystick_x);
        REQUIRE(bench.last.joystick_y == before.joystick_y);
      }
      bench.CheckRules();
    }
  }
}

TEST_CASE("the configuration is read back as written, and used") {
  Bench bench;
  bench.device.SetHand([](double time_s) {
    HandState hand;
    hand.insertion_mm = time_s < 1 ? 0 : 10;
    hand.joystick_x = 0.02;
    return hand;
  });
  bench.Start();
  REQUIRE(bench.Configure(12000, 30) == TransferStatus::kDone);
  bench.Run(0.1);
  CHECK(bench.last.cpi == 12000);
  CHECK(bench.last.joystick_x == 512);
  bench.Run(1);
  CHECK(bench.last.axial_counts == 4724);  // 10 mm at 12,000 counts per inch
  const auto back = bench.Get<protocol::ConfigurationReport>(protocol::kConfigurationReportId);
  CHECK(back.cpi == 12000);
  CHECK(back.joystick_deadzone == 30);
  CHECK(bench.gaps == 0);
  bench.CheckRules();
}

TEST_CASE("a bus reset at any instruction of the check for one is not lost") {
  const FirmwareImage image = Image16();
  const std::uint32_t entry = image.Symbol("_ZN7torquer5board12TakeUsbResetEv");
  for (int instructions = 0; instructions < 12; ++instructions) {
    Bench bench({}, image);
    bench.Start();
    Atmega32u4& chip = bench.device.chip();
    UsbController& usb = bench.device.usb();
    usb.StartOfFrame(0x321);
    chip.UpdateUsbInterrupts();
    for (int i = 0; i < 20000 && chip.StepInstruction() != entry; ++i) {
    }
    for (int i = 0; i < instructions; ++i) chip.StepInstruction();
    usb.BusReset();
    chip.UpdateUsbInterrupts();
    const double start_us = chip.now_us();
    chip.RunUntil(start_us + 2000);
    // GET_CONFIGURATION at address 0: the device has forgotten that it was configured.
    REQUIRE(usb.Setup(0, std::array<std::uint8_t, 8>{0x80, 8, 0, 0, 0, 0, 1, 0}) ==
            UsbAnswer::kAck);
    chip.UpdateUsbInterrupts();
    chip.RunUntil(start_us + 4000);
    Bytes answer;
    REQUIRE(usb.In(0, 0, &answer) == UsbAnswer::kAck);
    CAPTURE(instructions);
    CHECK(answer == Bytes{0});
  }
}

TEST_CASE("requests that make no sense are stalled, and reports go on") {
  Bench bench;
  bench.Start();
  CHECK(bench.Configure(50, 0) == TransferStatus::kStall);
  CHECK(bench.Configure(1200, 600) == TransferStatus::kStall);
  CHECK(bench.host.GetFeature(0).status == TransferStatus::kStall);
  CHECK(bench.host.GetFeature(protocol::kCommandReportId).status == TransferStatus::kStall);
  CHECK(bench.host.SetFeature(Bytes(64, 3)).status == TransferStatus::kStall);
  CHECK(bench.host.SetFeature({3, 1, 2}).status == TransferStatus::kStall);
  CHECK(bench.host.SetFeature({protocol::kIdentityReportId, 1}).status == TransferStatus::kStall);
  CHECK(bench.host.Control({0x80, 6, 0x0600, 0, 10}).status == TransferStatus::kStall);
  CHECK(bench.host.Control({0xc0, 0x55, 0, 0, 8}).status == TransferStatus::kStall);
  CHECK(bench.Get<protocol::IdentityReport>(protocol::kIdentityReportId).cpu_mhz == 16);
  CHECK(bench.gaps == 0);
  bench.CheckRules();
}

TEST_CASE("a halted endpoint stalls until the halt is cleared, and its toggle starts again") {
  Bench bench;
  int stalls = 0;
  bench.host.on_input_stall = [&stalls] { ++stalls; };
  bench.Start();
  REQUIRE(bench.host.Control({0x02, 3, 0, 0x81, 0}).status == TransferStatus::kDone);
  const int reports = bench.reports;
  bench.Run(0.01);
  CHECK(stalls >= 10);
  CHECK(bench.reports == reports);
  REQUIRE(bench.host.Control({0x02, 1, 0, 0x81, 0}).status == TransferStatus::kDone);
  bench.Run(0.01);
  CHECK(bench.reports >= reports + 8);
  bench.CheckRules();
}

TEST_CASE("transfers that the host aborts at any stage do not block the device") {
  Bench bench;
  bench.Start();
  UsbController& usb = bench.device.usb();
  const std::uint8_t requests[][8] = {
      {0x80, 6, 0, 2, 0, 0, 255, 0},  // a read of two packets
      {0xa1, 1, 4, 3, 0, 0, 64, 0},   // a feature report
      {0x21, 9, 3, 3, 0, 0, 16, 0},   // a write whose data never arrive
      {0x00, 9, 1, 0, 0, 0, 0, 0},    // no data
  };
  for (int round = 0; round < 5; ++round) {
    for (const auto& request : requests) {
      // 1 is the first address that this host assigns.
      REQUIRE(usb.Setup(1, std::span<const std::uint8_t, 8>(request)) == UsbAnswer::kAck);
      bench.device.chip().UpdateUsbInterrupts();
      for (int i = 0; i < round; ++i) bench.host.RunFrame();
      Bytes packet;
      if (round % 2) usb.In(1, 0, &packet);
      bench.device.chip().UpdateUsbInterrupts();
      bench.host.RunFrame();
      REQUIRE(bench.Diagnostics().reset_reason == 1);
    }
  }
  bench.Run(0.05);
  CHECK(bench.last.boot_id == 0);
  bench.CheckRules();
}

TEST_CASE("a bus reset brings the device back to its start, and it enumerates again") {
  Bench bench;
  bench.Start();
  const std::uint16_t before = bench.last.sequence;
  bench.host.ResetPort();
  CHECK_FALSE(bench.host.ready());
  REQUIRE(bench.host.RunUntilReady());
  bench.Run(0.1);
  CHECK(static_cast<std::uint16_t>(bench.last.sequence - before) < 500);
  CHECK(bench.host.toggle_errors() == 0);
}

TEST_CASE("the first report after a pause of the host is fresh") {
  Bench bench;
  bench.Start();
  const auto age_us = [&bench] { return bench.device.now_us() - bench.last.device_time_us; };
  const double usual_age_us = age_us();
  bench.polling = false;
  bench.Run(2);
  bench.polling = true;
  bench.host.RunFrame();
  CHECK(age_us() < usual_age_us + 3000);
  bench.gaps = 0;
  bench.Run(1);
  CHECK(bench.gaps == 0);
  CHECK(bench.Diagnostics().frames_missed < 10);
  bench.CheckRules();
}

}  // namespace
}  // namespace torquer::emulator
