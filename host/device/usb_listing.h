// The bench devices on this machine's USB, by what their descriptors tell: nothing is asked of a
// device that could disturb who uses it.
#pragma once

#include <libusb.h>

#include <cstdint>
#include <string>
#include <vector>

namespace torquer::device {

struct UsbListing {
  std::string serial;       ///< "" where it cannot be read
  std::string version;      ///< of the firmware, "1.2.3"
  std::string path;         ///< /dev/bus/usb/001/005
  std::string address;      ///< as in messages: "USB bus 1 device 5"
  bool bootloader = false;  ///< waits in its bootloader
  bool permitted = true;    ///< this user may open it
};

/// Devices of other makers with the same ids are left out, as far as permissions let that be told.
/// Throws UserError when the USB cannot be used at all.
std::vector<UsbListing> BenchDevicesHere();

/// "USB bus 1 device 5".
std::string UsbAddress(libusb_device* device);

/// A string descriptor as ASCII; "" if there is none, or the device does not tell it.
std::string UsbText(libusb_device_handle* handle, std::uint8_t index);

}  // namespace torquer::device
