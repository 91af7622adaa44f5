// Scripted USB devices for unmodified libusb: umockdev stands in for sysfs, udev and usbfs.
//
// The test and its children run with umockdev preloaded: NeedPrivateNetwork() of
// private_network.h sees to that. Each device plays a script: what
// it answers to control requests, and what it sends on its interrupt endpoint, in order.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace torquer::test {

/// One SETUP packet and its data.
struct ControlRequest {
  std::uint8_t type = 0;  ///< bmRequestType
  std::uint8_t request = 0;
  std::uint16_t value = 0;
  std::uint16_t index = 0;
  std::vector<std::uint8_t> data;  ///< host to device
};

/// How a device meets a request.
struct ControlAnswer {
  enum class Kind { kData, kStall, kSilence } kind = Kind::kData;
  std::vector<std::uint8_t> data{};  ///< device to host
};

/// What a device does when its interrupt endpoint is polled next.
struct InputStep {
  enum class Kind { kData, kStall, kError } kind = Kind::kData;
  std::vector<std::uint8_t> data{};
};

struct UsbDeviceScript {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::string manufacturer, product, serial;  ///< strings 1, 2, 3
  std::uint16_t input_packet_bytes = 32;      ///< of endpoint 1 IN
  int stalled_strings = 0;  ///< requests for strings that are stalled before the first answer
  int lost_claims = 0;      ///< claims that find the device gone, before the first that succeeds
  bool busy = false;        ///< another program has the interface
  /// Everything but the string descriptors comes here, from another thread.
  std::function<ControlAnswer(const ControlRequest&)> control;
};

class UsbTestbed {
 public:
  UsbTestbed();
  ~UsbTestbed();
  UsbTestbed(const UsbTestbed&) = delete;
  UsbTestbed& operator=(const UsbTestbed&) = delete;

  /// The folder that stands in for the root of the file system.
  std::string Root() const;

  /// Plugs a device in at `address` (1 .. 127) and announces it.
  void Plug(int address, const UsbDeviceScript& script);
  /// The device is gone: transfers in flight end, further requests fail; then it is announced.
  void Unplug(int address, bool announce = true);

  /// As after a suspend of the host: every transfer ends as if the device were gone, but it is not,
  /// and nothing is announced.
  void Lose(int address);

  /// To be done at the next polls, in order; without any, polls wait.
  void Input(int address, const InputStep& step);

  int ClearedHalts(int address) const;  ///< times that the host cleared the endpoint's halt
  bool Claimed(int address) const;      ///< a host has claimed the interface
  int TransfersWaiting(int address) const;

 private:
  struct Device;
  struct State;

  Device& At(int address) const;

  std::unique_ptr<State> state_;
};

}  // namespace torquer::test
