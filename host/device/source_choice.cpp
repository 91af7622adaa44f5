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
  options.Integer("--sensor", "N", choice.sensor, 1, 2,
                  "sensor of a box that has two: 1 is the wire's, 2 the catheter's");
  options.Text("--socket", "PATH", choice.socket,
               "path of the emulator's socket, for --source socket", ValueKind::kFile);
}

namespace {

std::shared_ptr<ReportSource> OpenBox(const SourceChoice& choice) {
  if (choice.source == "socket") return std::make_shared<SocketSource>(choice.socket);
  if (choice.source == "evdev") {
    if (choice.sensor != 1) throw UsageError("--source evdev has one sensor; leave out --sensor");
    return std::make_shared<EvdevSource>(choice.devices);
  }
  if (choice.source.empty()) {
    throw UsageError("--source is missing; give usb, hidraw, evdev or socket");
  }
  if (choice.devices.size() > 1) {
    throw UsageError("--source " + choice.source +
                     " reads one device; give --device once, with its serial number");
  }
  const std::string serial = choice.devices.empty() ? "" : choice.devices.front();
  if (choice.source == "hidraw") return std::make_shared<HidrawSource>(serial);
  return std::make_shared<UsbSource>(serial);
}

}  // namespace

std::unique_ptr<SensorView> OpenSource(const SourceChoice& choice) {
  return std::make_unique<SensorView>(OpenBox(choice), choice.sensor);
}

}  // namespace torquer::device
