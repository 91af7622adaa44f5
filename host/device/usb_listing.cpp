#include "host/device/usb_listing.h"

#include <fmt/format.h>

#include <algorithm>

#include "host/device/usb.h"
#include "protocol/usb_ids.h"

namespace torquer::device {
namespace {

// The version of the firmware is in the device descriptor: major in the upper byte, then four bits
// each.
std::string VersionOf(const libusb_device_descriptor& descriptor) {
  const unsigned version = descriptor.bcdDevice;
  return fmt::format("{}.{}.{}", version >> 8, (version >> 4) & 0xf, version & 0xf);
}

// False for another maker's device.
bool Describe(libusb_device* device, const libusb_device_descriptor& descriptor,
              UsbListing& listing) {
  libusb_device_handle* handle = nullptr;
  if (libusb_open(device, &handle) != 0) {
    listing.permitted = false;
    return true;
  }
  const bool ours = UsbText(handle, descriptor.iManufacturer) == protocol::kUsbManufacturer;
  listing.serial = UsbText(handle, descriptor.iSerialNumber);
  libusb_close(handle);
  return ours;
}

}  // namespace

std::vector<UsbListing> BenchDevicesHere() {
  std::vector<UsbListing> found;
  const UsbDevices usb;
  usb.ForEach([&](libusb_device* device, const libusb_device_descriptor& descriptor) {
    if (descriptor.idVendor != protocol::kUsbVendorId ||
        (descriptor.idProduct != protocol::kUsbProductId &&
         descriptor.idProduct != protocol::kUsbBootloaderProductId)) {
      return;
    }
    UsbListing listing;
    listing.bootloader = descriptor.idProduct == protocol::kUsbBootloaderProductId;
    listing.version = VersionOf(descriptor);
    listing.address = UsbAddress(device);
    listing.path = fmt::format("/dev/bus/usb/{:03}/{:03}", libusb_get_bus_number(device),
                               libusb_get_device_address(device));
    if (Describe(device, descriptor, listing)) found.push_back(listing);
  });
  std::sort(found.begin(), found.end(),
            [](const UsbListing& a, const UsbListing& b) { return a.path < b.path; });
  return found;
}

}  // namespace torquer::device
