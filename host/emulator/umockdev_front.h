// The emulated device as a Linux usbfs device, for unmodified libusb programs: umockdev redirects
// their system calls here. Works only in a process started under umockdev-wrapper (libusb then in
// the same process or in its children).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "host/emulator/bench_device.h"
#include "host/emulator/usb_host.h"

namespace torquer::emulator {

/// A bench device that runs in its own thread, on a mocked bus. Virtual time follows real time.
/// Once a program has claimed the interface, each frame also waits for its IN transfer. So no
/// report is lost on a loaded machine.
class UmockdevBench {
 public:
  /// Plugs the device in at a port (1 .. 9) of the one mocked bus, on which several may be. Throws
  /// UserError if the process is not under umockdev-wrapper.
  UmockdevBench(const FirmwareImage& image, const BenchOptions& options,
                std::function<HandState(double time_s)> hand, int port = 1);
  ~UmockdevBench();
  UmockdevBench(const UmockdevBench&) = delete;
  UmockdevBench& operator=(const UmockdevBench&) = delete;

  /// Takes the device off the bus, power included; transfers in flight fail as they do when a cable
  /// is pulled. Returns when it is gone.
  void Unplug();
  /// Plugs it in again; returns when it is enumerated.
  void Plug();

  /// Calls `action` in the device's thread, between two frames, and returns when it is done.
  void Do(const std::function<void(BenchDevice&, UsbHost&)>& action);

  /// Ends the next input transfer with this number of the report's bytes.
  void ShortenNextInput(std::size_t bytes);
  /// Ends the next input transfer with these bytes instead of the report's.
  void ReplaceNextInput(std::vector<std::uint8_t> bytes);
  /// Ends the next input transfer as on a halted endpoint.
  void StallNextInput();
  /// Stops or resumes all answers to control transfers.
  void HangControl(bool hang);

  /// Input reports handed to the program since the start.
  std::int64_t inputs_delivered() const;

 private:
  class Bus;

  void Run();

  BenchDevice device_;
  UsbHost host_;
  std::unique_ptr<Bus> bus_;
  std::mutex device_mutex_;  // held by the thread for each frame
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace torquer::emulator
