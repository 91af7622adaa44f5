#include "host/device/source_choice.h"

#include "host/device/evdev_source.h"
#include "host/device/hidraw_source.h"
#include "host/device/socket_source.h"
#include "host/device/usb_source.h"

namespace torquer::device {

void AddSourceOptions(Options& options, SourceChoice& choice) {
  options.Group("Device");
  options.Choice("--source", "KIND", {"usb", "hidraw", "evdev", "socket"}, choice.source,
                 "where reports come from (usb is the bench device, hidraw the same through the "
                 "kernel's HID driver, evdev an ordinary mouse and joystick, socket the emulator)");
  options.Texts("--device", "DEVICE", choice.devices,
                "with usb and hidraw the serial number, needed when there are several devices; "
                "with evdev the "
                "file of the mouse, and then of the joystick, in /dev/input");
  options.Text("--socket", "PATH", choice.socket,
               "with socket the path at which the emulator listens", ValueKind::kFile);
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
