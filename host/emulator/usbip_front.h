// The emulated device for a Linux kernel: a USB/IP server with one device, bus id 1-1, as
// `usbip attach` takes it. Once the kernel has requested input, each frame of virtual time waits
// for the next such transfer. So no report is lost on a slow machine.
#pragma once

#include <cstdint>
#include <deque>
#include <set>
#include <vector>

#include "host/emulator/usb_host.h"
#include "host/emulator/usbip_messages.h"

namespace torquer::emulator {

class UsbipFront {
 public:
  static constexpr char kBusId[] = "1-1";

  /// Listens on 127.0.0.1:`port`; 0 chooses a free port. `host` must outlive this; its callbacks
  /// are taken. Throws UserError where the port cannot be used.
  UsbipFront(UsbHost& host, std::uint16_t port);
  ~UsbipFront();
  UsbipFront(const UsbipFront&) = delete;
  UsbipFront& operator=(const UsbipFront&) = delete;

  std::uint16_t port() const { return port_; }

  /// Accepts, reads requests and sends answers; never waits. To be called once a frame.
  void Service();
  /// Waits up to `timeout_ms` for something to do for Service().
  void Wait(int timeout_ms) const;

  /// The next frame is to wait: the kernel has input transfers, and none is pending just now.
  bool HoldsFrame() const;

  /// A kernel has imported the device.
  bool imported() const { return imported_; }
  std::int64_t inputs_delivered() const { return inputs_delivered_; }

 private:
  struct Input {
    std::uint32_t sequence = 0;
    std::uint32_t length = 0;
  };

  void Read();
  bool TakeOperation();
  bool TakeTransfer();
  void StartTransfer(const usbip::Transfer& transfer, std::vector<std::uint8_t> data);
  void Unlink(const usbip::Transfer& transfer);
  void EndInput(std::int32_t status, const std::vector<std::uint8_t>& report);
  void Flush();
  void Disconnect();

  UsbHost& host_;
  std::uint16_t port_ = 0;
  int listener_ = -1;
  int client_ = -1;
  bool imported_ = false;
  bool last_reply_ = false;  // the connection ends once it is sent
  std::vector<std::uint8_t> received_;
  usbip::Bytes to_send_;
  std::deque<Input> inputs_;          // pending
  std::set<std::uint32_t> controls_;  // pending, by sequence
  bool streaming_ = false;            // input transfers come and go
  std::int64_t input_ended_ms_ = 0;
  std::uint64_t connection_ = 0;  // an answer for a former kernel must not reach the next
  std::int64_t inputs_delivered_ = 0;
};

}  // namespace torquer::emulator
