// libusb helpers: list the devices of this machine, their string descriptors and their addresses.
#pragma once

#include <libusb.h>

#include <cstdint>
#include <functional>
#include <string>

namespace torquer::device {

/// The remedy for a device that this user may not open.
inline constexpr char kPermissionRemedy[] =
    "install the udev rule: sudo cp hardware/udev/70-torquer.rules /etc/udev/rules.d/ && sudo "
    "udevadm control --reload && sudo udevadm trigger; a user who logs in remotely must also join "
    "its group: sudo groupadd -rf torquer && sudo usermod -aG torquer $USER, and log in again";

/// The devices on this machine's USB at one moment, with its own libusb context. Without udev, an
/// existing context does not notice new devices, so a new list needs a new object.
class UsbDevices {
 public:
  /// Throws UserError when the USB cannot be used at all.
  UsbDevices();
  ~UsbDevices();
  UsbDevices(const UsbDevices&) = delete;
  UsbDevices& operator=(const UsbDevices&) = delete;

  /// Calls `visit` for each device whose descriptor can be read. The device lives as long as this.
  void ForEach(
      const std::function<void(libusb_device*, const libusb_device_descriptor&)>& visit) const;

 private:
  libusb_context* context_ = nullptr;
  libusb_device** list_ = nullptr;
  ssize_t count_ = 0;
};

/// "USB bus 1 device 5".
std::string UsbAddress(libusb_device* device);

/// A string descriptor as ASCII; "" if there is none, or the device does not send it.
std::string UsbText(libusb_device_handle* handle, std::uint8_t index);

/// The string `name` ("product", "serial") as the kernel read it when the device was plugged in.
/// This needs no permission on the device. Returns "" if there is none.
std::string UsbTextOfKernel(libusb_device* device, const std::string& name);

}  // namespace torquer::device
