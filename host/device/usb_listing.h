// List of the bench devices on this machine's USB. It reads only descriptors, so it disturbs no
// program that uses a device.
#pragma once

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

/// Sorted by path. Devices of other makers with the same ids are left out, where permissions allow
/// to check that. Throws UserError when the USB cannot be used at all.
std::vector<UsbListing> BenchDevicesHere();

}  // namespace torquer::device
