// torquer-emulator-usbip: the emulated bench device for a Linux kernel, over USB/IP on the
// loopback.
#include <algorithm>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <numbers>
#include <string>
#include <thread>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"
#include "host/emulator/usbip_commands.h"
#include "host/emulator/usbip_front.h"
#include "host/support/command_line.h"
#include "host/support/error.h"

namespace {

using torquer::NumberIn;
using torquer::UserError;
using torquer::emulator::BenchDevice;
using torquer::emulator::FirmwareImage;
using torquer::emulator::UsbipFront;

constexpr char kUsage[] =
    "usage: torquer-emulator-usbip [--firmware ELF|none] [--bootloader ELF] [--port N] [..]\n"
    "\n"
    "  --firmware ELF|none     image to run (else the one of this build), or an empty flash\n"
    "  --bootloader ELF        our bootloader before it, in the flash's last 2 KiB\n"
    "  --port N                USB/IP on 127.0.0.1 (3240, as `usbip attach -r 127.0.0.1 -b 1-1`)\n"
    "  --commands N            port for commands, one a line: state, move MM RAD SECONDS,\n"
    "                          then MM RAD SECONDS, stick X Y, buttons BITS, unplug, plug, reset,\n"
    "                          restart, cut OPERATIONS (0: one that is free)\n"
    "  --serial TEXT           serial number in the EEPROM, up to 16 characters\n"
    "  --cylinder-radius-mm R  of the cylinder that the sensor looks at (5.0)\n"
    "  --misalign_deg A        the sensor is mounted askew by A degrees\n"
    "  --scale F               the sensor counts F times as much as it should\n";

constexpr auto kFrame = std::chrono::milliseconds(1);

volatile std::sig_atomic_t stop_requested = 0;
void RequestStop(int) { stop_requested = 1; }

struct Arguments {
  std::string firmware;
  std::string bootloader;
  std::uint16_t port = 3240;
  std::uint16_t commands = 0;
  torquer::emulator::BenchOptions bench;
  bool help = false;
};

std::uint16_t PortOf(const std::string& option, const std::string& text) {
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc() || end != text.data() + text.size()) {
    throw UserError(option + " '" + text + "': give a number from 0 to 65535");
  }
  return port;
}

Arguments Parse(int argc, char** argv) {
  Arguments arguments;
  torquer::CommandLine line;
  line.Option("--firmware", arguments.firmware);
  line.Option("--port", [&](const std::string& text) { arguments.port = PortOf("--port", text); });
  line.Option("--commands",
              [&](const std::string& text) { arguments.commands = PortOf("--commands", text); });
  line.Option("--bootloader", arguments.bootloader);
  line.Option("--serial", arguments.bench.serial);
  line.Option("--cylinder-radius-mm", [&](const std::string& text) {
    arguments.bench.cylinder_radius_mm = NumberIn("--cylinder-radius-mm", text, 0.1, 1000);
  });
  line.Option("--misalign_deg", [&](const std::string& text) {
    arguments.bench.sensor.misalignment_rad =
        NumberIn("--misalign_deg", text, -180, 180) * std::numbers::pi / 180;
  });
  line.Option("--scale", [&](const std::string& text) {
    arguments.bench.sensor.scale = NumberIn("--scale", text, 0.01, 100);
  });
  line.Flag("--help", arguments.help);
  line.Parse(argc, argv, kUsage);
  if (arguments.firmware.empty()) {
    arguments.firmware = FirmwareImage::OfThisBuild();
  } else if (arguments.firmware == "none") {
    if (arguments.bootloader.empty()) {
      throw UserError("--firmware none: without --bootloader nothing would run; give one of both");
    }
    arguments.firmware.clear();
  }
  return arguments;
}

// Frames follow real time, but never overtake the kernel at the other end.
void Run(UsbipFront& front, torquer::emulator::LinePort& commands,
         torquer::emulator::UsbHost& host) {
  auto next_frame = std::chrono::steady_clock::now();
  while (!stop_requested) {
    front.Service();
    commands.Service();
    const auto now = std::chrono::steady_clock::now();
    if (front.HoldsFrame()) {
      front.Wait(1);
    } else if (now < next_frame) {
      std::this_thread::sleep_until(next_frame);
    } else {
      host.RunFrame();
      next_frame = std::max(next_frame + kFrame, now - kFrame);
    }
  }
}

int Main(int argc, char** argv) {
  const Arguments arguments = Parse(argc, argv);
  if (arguments.help) {
    std::printf("%s", kUsage);
    return 0;
  }
  struct sigaction action {};
  action.sa_handler = &RequestStop;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);

  BenchDevice device(FirmwareImage::Load(arguments.firmware, arguments.bootloader),
                     arguments.bench);
  torquer::emulator::UsbHost host(device);
  UsbipFront front(host, arguments.port);
  torquer::emulator::UsbipCommands doer(device, host, [&front] {
    return "\"imported\":" + std::string(front.imported() ? "true" : "false") +
           ",\"inputs\":" + std::to_string(front.inputs_delivered()) + ",";
  });
  torquer::emulator::LinePort commands(arguments.commands,
                                       [&doer](const std::string& line) { return doer.Do(line); });
  std::printf("torquer-emulator-usbip: device 1-1 at port %d, commands at port %d\n", front.port(),
              commands.port());
  std::fflush(stdout);
  Run(front, commands, host);
  for (const std::string& text : device.Violations()) {
    std::fprintf(stderr, "torquer-emulator-usbip: the firmware would fail on hardware: %s\n",
                 text.c_str());
  }
  return device.violation_count() == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return Main(argc, argv);
  } catch (const UserError& error) {
    std::fprintf(stderr, "torquer-emulator-usbip: %s\n", error.what());
    return torquer::kExitUserError;
  }
}
