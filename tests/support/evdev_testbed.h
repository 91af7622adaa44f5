// Scripted input devices for unmodified libevdev: umockdev stands in for /dev/input and its ioctls.
// The test and its children run with umockdev preloaded, see private_network.h.
#pragma once

#include <linux/input.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace torquer::test {

struct EvdevScript {
  std::string name;
  std::uint16_t vendor_id = 0x046d;
  std::uint16_t product_id = 0xc077;
  std::vector<unsigned> keys, relative_axes;
  std::map<unsigned, input_absinfo> absolute_axes;
  bool refuses_grab = false;  ///< as when another program has it
};

class EvdevTestbed {
 public:
  EvdevTestbed();
  ~EvdevTestbed();
  EvdevTestbed(const EvdevTestbed&) = delete;
  EvdevTestbed& operator=(const EvdevTestbed&) = delete;

  /// The folder that stands in for the root of the file system.
  std::filesystem::path Root() const;

  /// Adds /dev/input/event<number>, a number not used before, and a lasting name for it in
  /// /dev/input/by-id as udev would; the path of that.
  std::string Plug(int number, const EvdevScript& script);
  void Unplug(int number);

  /// Sends events, and a SYN_REPORT after them, stamped with `time_us`.
  struct Event {
    unsigned type, code;
    int value;
  };
  void Send(int number, const std::vector<Event>& events, std::int64_t time_us);
  /// As when the reader was too slow for the kernel's queue.
  void SendDropped(int number, std::int64_t time_us);
  /// Which keys are down when the reader asks, after events were dropped.
  void SetKeyState(int number, unsigned key, bool down);

  bool Grabbed(int number) const;
  int ClockId(int number) const;  ///< as the reader has set it, -1 before

 private:
  struct Device;
  struct State;

  std::unique_ptr<State> state_;
};

}  // namespace torquer::test
