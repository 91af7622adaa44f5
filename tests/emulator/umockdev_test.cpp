// Unmodified libusb against the real firmware: umockdev mocks usbfs, and the emulated device runs
// behind it. The conversations follow those of a driver.
#include <libudev.h>
#include <libusb.h>

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "host/emulator/umockdev_front.h"
#include "protocol/hid_descriptor.h"
#include "protocol/hid_reports.h"
#include "protocol/usb_ids.h"
#include "tests/support/paths.h"
#include "tests/support/usb_program.h"

namespace torquer::emulator {
namespace {

using hil::kInput;
using hil::kTimeoutMs;

HandState StillHand(double) { return {}; }
HandState FastHand(double time_s) {
  HandState hand;
  hand.insertion_mm = 1000 * time_s;
  return hand;
}

FirmwareImage Image() { return FirmwareImage(torquer::test::FirmwarePath("torquer-firmware.elf")); }

using hil::Program;

TEST_CASE("libusb finds the device by its ids and reads its strings and report descriptor") {
  BenchOptions options;
  options.serial = "BENCH-7";
  UmockdevBench bench(Image(), options, StillHand);
  Program program;
  program.Open();
  libusb_device_descriptor descriptor;
  REQUIRE(libusb_get_device_descriptor(libusb_get_device(program.handle()), &descriptor) == 0);
  CHECK(descriptor.bMaxPacketSize0 == protocol::kControlPacketBytes);
  unsigned char text[64];
  REQUIRE(libusb_get_string_descriptor_ascii(program.handle(), descriptor.iSerialNumber, text,
                                             sizeof(text)) == 7);
  CHECK(std::string(reinterpret_cast<char*>(text)) == "BENCH-7");
  unsigned char bytes[256];
  const int size = libusb_control_transfer(program.handle(), 0x81, 6, 0x2200, 0, bytes,
                                           sizeof(bytes), kTimeoutMs);
  REQUIRE(size == sizeof(protocol::kHidReportDescriptor));
  CHECK(std::memcmp(bytes, protocol::kHidReportDescriptor,
                    sizeof(protocol::kHidReportDescriptor)) == 0);
}

TEST_CASE("libusb reads a second of reports without a gap") {
  UmockdevBench bench(Image(), {}, FastHand);
  Program program;
  program.Open();
  // Both banks of the endpoint were full before the program connected. One report was dropped
  // because there is no third bank.
  for (int i = 0; i < 3; ++i) program.ReadReport();
  protocol::InputReport last = program.ReadReport();
  for (int i = 0; i < 1000; ++i) {
    const protocol::InputReport report = program.ReadReport();
    REQUIRE(report.sequence == static_cast<std::uint16_t>(last.sequence + 1));
    REQUIRE(report.boot_id == last.boot_id);
    last = report;
  }
}

TEST_CASE("feature reports pass through libusb both ways, and a bad one is a pipe error") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  program.Open();
  std::vector<unsigned char> report;
  REQUIRE(program.GetFeature(protocol::kConfigurationReportId, &report) == 16);
  protocol::ConfigurationReport configuration;
  std::memcpy(&configuration, report.data(), sizeof(configuration));
  configuration.cpi = 3200;
  std::memcpy(report.data(), &configuration, sizeof(configuration));
  CHECK(program.SetFeature(report) == 16);
  std::vector<unsigned char> back;
  REQUIRE(program.GetFeature(protocol::kConfigurationReportId, &back) == 16);
  CHECK(back == report);

  report[1] = 99;  // another protocol version
  CHECK(program.SetFeature(report) == LIBUSB_ERROR_PIPE);
  CHECK(program.GetFeature(77, &back) == LIBUSB_ERROR_PIPE);
  CHECK(program.GetFeature(protocol::kIdentityReportId, &back) == 32);
}

TEST_CASE("a stalled input transfer is a pipe error, and clearing the halt repairs it") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  program.Open();
  std::vector<unsigned char> packet;
  // First stall: the device halts its endpoint on request.
  REQUIRE(libusb_control_transfer(program.handle(), 0x02, 3, 0, kInput, nullptr, 0, kTimeoutMs) ==
          0);
  CHECK(program.ReadInput(&packet) == LIBUSB_ERROR_PIPE);
  CHECK(program.ReadInput(&packet) == LIBUSB_ERROR_PIPE);
  REQUIRE(libusb_clear_halt(program.handle(), kInput) == 0);
  CHECK(program.ReadInput(&packet) == 0);
  // Second stall: on the wire.
  bench.StallNextInput();
  CHECK(program.ReadInput(&packet) == LIBUSB_ERROR_PIPE);
  CHECK(program.ReadInput(&packet) == 0);
}

TEST_CASE("a short packet arrives short") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  program.Open();
  bench.ShortenNextInput(7);
  std::vector<unsigned char> packet;
  REQUIRE(program.ReadInput(&packet) == 0);
  CHECK(packet.size() == 7);
  REQUIRE(program.ReadInput(&packet) == 0);
  CHECK(packet.size() == sizeof(protocol::InputReport));
}

TEST_CASE("an unanswered control request times out, and the next one is served") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  program.Open();
  bench.HangControl(true);
  std::vector<unsigned char> report;
  CHECK(program.GetFeature(protocol::kIdentityReportId, &report, 50) == LIBUSB_ERROR_TIMEOUT);
  bench.HangControl(false);
  CHECK(program.GetFeature(protocol::kIdentityReportId, &report) == 32);
}

TEST_CASE("unplugged with a transfer in flight, and plugged in again") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  program.Open();
  const protocol::InputReport before = program.ReadReport();
  std::thread cable([&bench] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    bench.Unplug();
  });
  std::vector<unsigned char> packet;
  int result = 0;
  while (result == 0) result = program.ReadInput(&packet);
  cable.join();
  CHECK((result == LIBUSB_ERROR_NO_DEVICE || result == LIBUSB_ERROR_IO));
  program.Close();

  bench.Plug();
  program.Open();
  const protocol::InputReport after = program.ReadReport();
  CHECK(after.boot_id != before.boot_id);
  CHECK(after.device_time_us < before.device_time_us + 1000000);
}

struct Hotplug {
  int arrived = 0;
  int left = 0;
};

int LIBUSB_CALL OnHotplug(libusb_context*, libusb_device*, libusb_hotplug_event event, void* seen) {
  auto* hotplug = static_cast<Hotplug*>(seen);
  ++(event == LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED ? hotplug->arrived : hotplug->left);
  return 0;
}

TEST_CASE("libusb sees the cable pulled and put back") {
  UmockdevBench bench(Image(), {}, StillHand);
  Program program;
  Hotplug hotplug;
  libusb_hotplug_callback_handle callback;
  REQUIRE(libusb_hotplug_register_callback(
              program.context(),
              LIBUSB_HOTPLUG_EVENT_DEVICE_ARRIVED | LIBUSB_HOTPLUG_EVENT_DEVICE_LEFT,
              LIBUSB_HOTPLUG_ENUMERATE, protocol::kUsbVendorId, protocol::kUsbProductId,
              LIBUSB_HOTPLUG_MATCH_ANY, &OnHotplug, &hotplug, &callback) == 0);
  CHECK(hotplug.arrived == 1);
  const auto wait_for = [&program](const int& counter, int value) {
    for (int i = 0; i < 100 && counter < value; ++i) {
      timeval timeout{0, 50000};
      libusb_handle_events_timeout_completed(program.context(), &timeout, nullptr);
    }
    return counter == value;
  };
  bench.Unplug();
  CHECK(wait_for(hotplug.left, 1));
  bench.Plug();
  CHECK(wait_for(hotplug.arrived, 2));
}

TEST_CASE("programs begin and end to watch the bus while the cable is pulled and put back") {
  UmockdevBench bench(Image(), {}, StillHand);
  std::atomic<bool> stop = false;
  std::atomic<int> watched = 0;
  std::thread programs([&stop, &watched] {
    // Watches as libusb does; libusb itself would leak events that arrive while it closes.
    while (!stop) {
      udev* context = udev_new();
      udev_monitor* monitor = udev_monitor_new_from_netlink(context, "udev");
      if (monitor != nullptr && udev_monitor_enable_receiving(monitor) >= 0) ++watched;
      udev_monitor_unref(monitor);
      udev_unref(context);
    }
  });
  for (int i = 0; i < 100; ++i) {
    bench.Unplug();
    bench.Plug();
  }
  stop = true;
  programs.join();
  CHECK(watched > 100);
}

TEST_CASE("a program that watches the bus without reading holds up nobody") {
  UmockdevBench bench(Image(), {}, StillHand);
  udev* context = udev_new();
  udev_monitor* monitor = udev_monitor_new_from_netlink(context, "udev");
  REQUIRE(monitor != nullptr);
  REQUIRE(udev_monitor_enable_receiving(monitor) >= 0);
  // More cycles than the socket holds events.
  int room = 0;
  std::ifstream("/proc/sys/net/unix/max_dgram_qlen") >> room;
  REQUIRE(room > 0);
  for (int i = 0; i < room + 2; ++i) {
    bench.Unplug();
    bench.Plug();
  }
  // The kernel drops events for which there is no room, and the first ones stay.
  udev_device* device = udev_monitor_receive_device(monitor);
  REQUIRE(device != nullptr);
  CHECK(std::string(udev_device_get_action(device)) == "remove");
  udev_device_unref(device);
  udev_monitor_unref(monitor);
  udev_unref(context);
}

}  // namespace
}  // namespace torquer::emulator
