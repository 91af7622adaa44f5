#include "host/daemon/device_list.h"

#include <filesystem>

#include "calibration/calibration_file.h"
#include "host/daemon/claim.h"
#include "host/device/evdev_source.h"
#include "host/device/usb_listing.h"
#include "host/support/error.h"

namespace torquer::daemon {
namespace {

std::string CalibrationOf(const std::string& serial) {
  try {
    const std::string path = calibration::CalibrationPath(serial);
    std::error_code error;
    if (!std::filesystem::exists(path, error)) return "not calibrated (no " + path + ")";
    calibration::RequireDevice(calibration::ReadCalibration(path), path, serial);
    return "calibrated by " + path;
  } catch (const UserError& refusal) {
    return std::string("calibration refused: ") + refusal.what();
  }
}

std::string LineOf(const device::UsbListing& device) {
  const std::string serial = device.serial.empty() ? "serial number unknown" : device.serial;
  std::string line = "  " + serial + "  ";
  if (device.bootloader) {
    return line + "in its bootloader  " + device.path + "  give it firmware with torquer-flash\n";
  }
  line += "firmware " + device.version + "  " + device.path + "  ";
  if (!device.permitted) {
    return line +
           "may not be opened by this user; install the udev rule: sudo cp "
           "hardware/udev/70-torquer.rules /etc/udev/rules.d/ && sudo udevadm control --reload "
           "&& sudo udevadm trigger\n";
  }
  line += CalibrationOf(device.serial);
  const auto user = ClaimHolder(DeviceClaimName(device.address + " " + device.serial));
  if (user) line += "  read by process " + std::to_string(*user);
  return line + "\n";
}

}  // namespace

std::string DeviceList() {
  std::string list = "bench devices, for --source usb --device SERIAL\n";
  const std::vector<device::UsbListing> devices = device::BenchDevicesHere();
  for (const device::UsbListing& device : devices) list += LineOf(device);
  if (devices.empty()) list += "  none is plugged in\n";

  list += "mice and joysticks, for --source evdev --device PATH\n";
  const std::vector<device::InputListing> inputs = device::InputsHere();
  for (const device::InputListing& input : inputs) {
    list += "  " + input.serial + "  " + (input.is_mouse ? "mouse" : "joystick") + "  " +
            input.path + "  (" + input.name + ")";
    list += input.is_mouse ? "  " + CalibrationOf(input.serial) + "\n" : "\n";
  }
  if (inputs.empty()) {
    list += "  none that this user may read; group input may: sudo usermod -aG input $USER\n";
  }
  return list;
}

}  // namespace torquer::daemon
