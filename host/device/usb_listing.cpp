#include "host/device/usb_listing.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "host/support/error.h"
#include "protocol/usb_ids.h"

namespace torquer::device {
namespace {

// The firmware's version stands in the device descriptor: major in the upper byte, then a nibble
// each.
std::string VersionOf(const libusb_device_descriptor& descriptor) {
  return std::to_string(descriptor.bcdDevice >> 8) + "." +
         std::to_string((descriptor.bcdDevice >> 4) & 0xf) + "." +
         std::to_string(descriptor.bcdDevice & 0xf);
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

std::string UsbAddress(libusb_device* device) {
  return "USB bus " + std::to_string(libusb_get_bus_number(device)) + " device " +
         std::to_string(libusb_get_device_address(device));
}

std::string UsbText(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 128> text{};
  const int length = index == 0 ? 0
                                : libusb_get_string_descriptor_ascii(handle, index, text.data(),
                                                                     static_cast<int>(text.size()));
  return {reinterpret_cast<const char*>(text.data()),
          static_cast<std::size_t>(std::max(length, 0))};
}

std::vector<UsbListing> BenchDevicesHere() {
  libusb_context* context = nullptr;
  const int error = libusb_init(&context);
  if (error != 0) {
    throw UserError(std::string("the USB cannot be used: ") + libusb_strerror(error) +
                    "; is /dev/bus/usb there?");
  }
  std::vector<UsbListing> found;
  libusb_device** devices = nullptr;
  const ssize_t count = libusb_get_device_list(context, &devices);
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(devices[i], &descriptor) != 0 ||
        descriptor.idVendor != protocol::kUsbVendorId ||
        (descriptor.idProduct != protocol::kUsbProductId &&
         descriptor.idProduct != protocol::kUsbBootloaderProductId)) {
      continue;
    }
    UsbListing listing;
    listing.bootloader = descriptor.idProduct == protocol::kUsbBootloaderProductId;
    listing.version = VersionOf(descriptor);
    listing.address = UsbAddress(devices[i]);
    char path[40];
    std::snprintf(path, sizeof path, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(devices[i]),
                  libusb_get_device_address(devices[i]));
    listing.path = path;
    if (Describe(devices[i], descriptor, listing)) found.push_back(listing);
  }
  if (count >= 0) libusb_free_device_list(devices, 1);
  libusb_exit(context);
  std::sort(found.begin(), found.end(),
            [](const UsbListing& a, const UsbListing& b) { return a.path < b.path; });
  return found;
}

}  // namespace torquer::device
