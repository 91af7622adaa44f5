// Daemon as a user runs it, on the firmware's image behind a mocked usbfs; and a hand for the
// device.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "host/emulator/umockdev_front.h"
#include "tests/support/daemon_process.h"
#include "tests/support/paths.h"

namespace torquer::hil {

using emulator::BenchOptions;
using emulator::FirmwareImage;
using emulator::HandState;
using test::ChildProcess;

inline constexpr double kMmPerCount = 25.4 / 1200;

// Hand that rests until requested, then pushes by 100 mm and turns by 2 rad in one second.
class PushingHand {
 public:
  HandState operator()(double time_s) {
    if (asked_.exchange(false)) {
      from_ = to_;
      to_ += 1.0;
      start_s_ = time_s;
    }
    const double done = from_ + std::clamp(time_s - start_s_, 0.0, to_ - from_);
    HandState hand;
    hand.insertion_mm = 100.0 * done;
    hand.rotation_rad = 2.0 * done;
    hand.buttons = held_;
    return hand;
  }
  void Push() { asked_ = true; }
  /// Holds these buttons (protocol::Button bits) from now on.
  void Hold(std::uint8_t buttons) { held_ = buttons; }

 private:
  std::atomic<std::uint8_t> held_ = 0;
  std::atomic<bool> asked_ = false;
  double from_ = 0.0, to_ = 0.0, start_s_ = 0.0;
};

inline FirmwareImage Image() { return FirmwareImage(test::FirmwarePath("torquer-firmware.elf")); }

/// Daemon with `--source usb` and these words.
inline std::unique_ptr<ChildProcess> UsbDaemon(const std::vector<std::string>& more) {
  std::vector<std::string> words{test::kDaemonProgram, "--source", "usb"};
  words.insert(words.end(), more.begin(), more.end());
  return std::make_unique<ChildProcess>(words);
}

inline BenchOptions HilOptions(const std::string& serial) {
  BenchOptions options;
  options.serial = serial;
  // The device's clock wraps within the first seconds of every start.
  options.start_time_us = 4294967295u - 2500000u;
  return options;
}

}  // namespace torquer::hil
