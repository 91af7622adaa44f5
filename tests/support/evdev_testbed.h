// Scripted input devices for unmodified libevdev: umockdev replaces /dev/input and its ioctls. The
// test and its children run with umockdev preloaded, see private_network.h.
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
  bool refuses_grab = false;  ///< as if another program had grabbed it
};

class EvdevTestbed {
 public:
  EvdevTestbed();
  ~EvdevTestbed();
  EvdevTestbed(const EvdevTestbed&) = delete;
  EvdevTestbed& operator=(const EvdevTestbed&) = delete;

  /// Folder that replaces the root of the file system.
  std::filesystem::path Root() const;

  /// Adds /dev/input/event<number>, a number not used before. Also adds a persistent name in
  /// /dev/input/by-id, as udev would, and returns its path.
  std::string Plug(int number, const EvdevScript& script);
  void Unplug(int number);

  /// Event to send; a SYN_REPORT follows the events, stamped with `time_us`.
  struct Event {
    unsigned type, code;
    int value;
  };
  void Send(int number, const std::vector<Event>& events, std::int64_t time_us);
  /// Signals dropped events, as if the reader were too slow for the kernel's queue.
  void SendDropped(int number, std::int64_t time_us);
  /// Sets a key's state for the reader's query after dropped events.
  void SetKeyState(int number, unsigned key, bool down);

  bool Grabbed(int number) const;
  int ClockId(int number) const;  ///< set by the reader; -1 before

 private:
  struct Device;
  struct State;

  std::unique_ptr<State> state_;
};

}  // namespace torquer::test
