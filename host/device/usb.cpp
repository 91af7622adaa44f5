#include "host/device/usb.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "host/support/error.h"

namespace torquer::device {

UsbDevices::UsbDevices() {
  const int error = libusb_init(&context_);
  if (error != 0) {
    throw UserError(fmt::format("the USB cannot be used: {}; check that /dev/bus/usb exists",
                                libusb_strerror(error)));
  }
  count_ = libusb_get_device_list(context_, &list_);
}

UsbDevices::~UsbDevices() {
  if (list_ != nullptr) libusb_free_device_list(list_, 1);
  libusb_exit(context_);
}

void UsbDevices::ForEach(
    const std::function<void(libusb_device*, const libusb_device_descriptor&)>& visit) const {
  for (ssize_t i = 0; i < count_; ++i) {
    libusb_device_descriptor descriptor{};
    if (libusb_get_device_descriptor(list_[i], &descriptor) == 0) visit(list_[i], descriptor);
  }
}

std::string UsbAddress(libusb_device* device) {
  return fmt::format("USB bus {} device {}", libusb_get_bus_number(device),
                     libusb_get_device_address(device));
}

std::string UsbText(libusb_device_handle* handle, std::uint8_t index) {
  std::array<unsigned char, 128> text{};
  const int length = index == 0 ? 0
                                : libusb_get_string_descriptor_ascii(handle, index, text.data(),
                                                                     static_cast<int>(text.size()));
  return {reinterpret_cast<const char*>(text.data()),
          static_cast<std::size_t>(std::max(length, 0))};
}

std::string UsbTextOfKernel(libusb_device* device, const std::string& name) {
  std::array<std::uint8_t, 8> ports{};
  const int count = libusb_get_port_numbers(device, ports.data(), static_cast<int>(ports.size()));
  if (count <= 0) return "";
  const std::string place = fmt::format("{}-{}", libusb_get_bus_number(device),
                                        fmt::join(ports.begin(), ports.begin() + count, "."));
  std::ifstream file(fmt::format("/sys/bus/usb/devices/{}/{}", place, name));
  std::string text;
  std::getline(file, text);
  return text;
}

}  // namespace torquer::device
