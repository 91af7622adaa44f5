// torquer-emulator-usbip: the emulated bench device for a Linux kernel, over USB/IP on the
// loopback.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <thread>

#include "host/emulator/bench_choice.h"
#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"
#include "host/emulator/usbip_commands.h"
#include "host/emulator/usbip_front.h"
#include "host/support/error_output.h"
#include "host/support/program.h"
#include "host/support/stop_signal.h"

namespace {

using torquer::emulator::BenchDevice;
using torquer::emulator::UsbipFront;

constexpr auto kFrame = std::chrono::milliseconds(1);

struct Arguments {
  std::uint16_t port = 3240;
  std::uint16_t commands = 0;
  torquer::emulator::BenchChoice bench;
};

// Frames follow real time, but never overtake the kernel at the other end.
void Serve(UsbipFront& front, torquer::emulator::LinePort& commands,
           torquer::emulator::UsbHost& host, const std::atomic<bool>& stop) {
  auto next_frame = std::chrono::steady_clock::now();
  while (!stop) {
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

int Run(Arguments& arguments) {
  arguments.bench.Complete();
  const std::atomic<bool>& stop = torquer::StopOnSignal();
  BenchDevice device(
      torquer::emulator::FirmwareImage::Load(arguments.bench.firmware, arguments.bench.bootloader),
      arguments.bench.options);
  torquer::emulator::UsbHost host(device);
  UsbipFront front(host, arguments.port);
  torquer::emulator::UsbipCommands doer(device, host, [&front] {
    return fmt::format("\"imported\":{},\"inputs\":{},", front.imported(),
                       front.inputs_delivered());
  });
  torquer::emulator::LinePort commands(arguments.commands,
                                       [&doer](const std::string& line) { return doer.Do(line); });
  fmt::print("torquer-emulator-usbip: device {} at port {}, commands at port {}\n",
             UsbipFront::kBusId, front.port(), commands.port());
  std::fflush(stdout);
  Serve(front, commands, host, stop);
  for (const std::string& text : device.Violations()) {
    torquer::PrintError("torquer-emulator-usbip: the firmware would fail on hardware: {}\n", text);
  }
  return device.violation_count() == 0 ? torquer::kExitSuccess : torquer::kExitFailure;
}

}  // namespace

int main(int argc, char** argv) {
  torquer::Program program("torquer-emulator-usbip",
                           "Offers the emulated bench device to a Linux kernel by USB/IP on "
                           "127.0.0.1. Attach it with: usbip attach -r 127.0.0.1 -b 1-1");
  program.Note(
      "The command port accepts one command per line and answers each with one line: state, move "
      "MM RAD SECONDS, then MM RAD SECONDS, stick X Y, buttons BITS, unplug, plug, reset, restart, "
      "cut OPERATIONS.");
  program.Note(
      "Exit status: 0 on success; 1 when the firmware violated a rule of the hardware; 2 when an "
      "option, a file or a port cannot be used.");
  Arguments arguments;
  torquer::Options& options = program.options();
  options.Group("Connections");
  options.Integer("--port", "N", arguments.port, 0, 65535, "TCP port for USB/IP; 0: any free port");
  options.Integer("--commands", "N", arguments.commands, 0, 65535,
                  "TCP port for commands; 0: any free port");
  torquer::emulator::AddBenchOptions(options, arguments.bench);
  return program.Main(argc, argv, [&] { return Run(arguments); });
}
