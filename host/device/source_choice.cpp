#include "host/device/source_choice.h"

#include "host/device/evdev_source.h"
#include "host/device/hidraw_source.h"
#include "host/device/socket_source.h"
#include "host/device/usb_source.h"

namespace torquer::device {

void AddSourceOptions(Options& options, SourceChoice& choice) {
  options.Group("Device");
  options.Choice(
      "--source", "KIND", {"usb", "hidraw", "evdev", "socket"}, choice.source,
      "source of the reports (usb is the bench device; hidraw is the bench device through the "
      "kernel's HID driver; evdev is an ordinary mouse and joystick; socket is the emulator)");
  options.Texts(
      "--device", "DEVICE", choice.devices,
      "device to read: with usb and hidraw its serial number, required when there are several "
      "devices; with evdev the file of the mouse in /dev/input, then that of the joystick");
  options.Text("--socket", "PATH", choice.socket,
               "path of the emulator's socket, for --source socket", ValueKind::kFile);
}

std::unique_ptr<ReportSource> OpenSource(const SourceChoice& choice) {
  if (choice.source == "socket") {
    return std::make_unique<SocketSource>(choice.socket);
  }
  if (choice.source == "evdev") return std::make_unique<EvdevSource>(choice.devices);
  if (choice.source.empty()) {
    throw UsageError("--source is missing; give usb, hidraw, evdev or socket");
  }
  if (choice.devices.size() > 1) {
    throw UsageError("--source " + choice.source +
                     " reads one device; give --device once, with its serial number");
  }
  const std::string serial = choice.devices.empty() ? "" : choice.devices.front();
  if (choice.source == "hidraw") return std::make_unique<HidrawSource>(serial);
  return std::make_unique<UsbSource>(serial);
}

}  // namespace torquer::device
