// Scripted USB devices for unmodified libusb: umockdev replaces sysfs, udev and usbfs.
//
// The test and its children run with umockdev preloaded, by NeedPrivateNetwork() of
// private_network.h. Each device follows a script: answers to control requests, and data on its
// interrupt endpoint, in order.
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

/// Answer of a device to a request.
struct ControlAnswer {
  enum class Kind { kData, kStall, kSilence } kind = Kind::kData;
  std::vector<std::uint8_t> data{};  ///< device to host
};

/// Reaction of a device to the next poll of its interrupt endpoint.
struct InputStep {
  enum class Kind { kData, kStall, kError } kind = Kind::kData;
  std::vector<std::uint8_t> data{};
};

struct UsbDeviceScript {
  std::uint16_t vendor_id = 0;
  std::uint16_t product_id = 0;
  std::string manufacturer, product, serial;  ///< strings 1, 2, 3
  std::uint16_t input_packet_bytes = 32;      ///< of endpoint 1 IN
  int stalled_strings = 0;  ///< number of stalled string requests before the first answer
  int lost_claims = 0;      ///< number of claims that fail before one succeeds
  bool busy = false;        ///< another program has claimed the interface
  /// Answers all requests except string descriptors; called from another thread.
  std::function<ControlAnswer(const ControlRequest&)> control;
};

class UsbTestbed {
 public:
  UsbTestbed();
  ~UsbTestbed();
  UsbTestbed(const UsbTestbed&) = delete;
  UsbTestbed& operator=(const UsbTestbed&) = delete;

  /// Folder that replaces the root of the file system.
  std::string Root() const;

  /// Plugs a device in at `address` (1 .. 127) and announces it.
  void Plug(int address, const UsbDeviceScript& script);
  /// Removes the device: transfers in flight end, further requests fail; then it is announced.
  void Unplug(int address, bool announce = true);

  /// Ends every transfer as if the device were gone, without removing or announcing it. The kernel
  /// does this after a suspend of the host.
  void Lose(int address);

  /// Appends a step for the next polls; without steps, polls wait.
  void Input(int address, const InputStep& step);

  int ClearedHalts(int address) const;  ///< how often the host cleared the endpoint's halt
  bool Claimed(int address) const;      ///< a host has claimed the interface
  int TransfersWaiting(int address) const;

 private:
  struct Device;
  struct State;

  Device& At(int address) const;

  std::unique_ptr<State> state_;
};

}  // namespace torquer::test
