#include "host/daemon/device_list.h"

#include <fmt/format.h>

#include <filesystem>

#include "calibration/calibration_file.h"
#include "host/daemon/claim.h"
#include "host/device/evdev_source.h"
#include "host/device/usb.h"
#include "host/device/usb_listing.h"
#include "host/support/error.h"

namespace torquer::daemon {
namespace {

std::string CalibrationOf(const std::string& serial) {
  try {
    const std::string path = calibration::CalibrationPath(serial);
    std::error_code error;
    if (!std::filesystem::exists(path, error)) return fmt::format("not calibrated (no {})", path);
    calibration::RequireDevice(calibration::ReadCalibration(path), path, serial);
    return fmt::format("calibrated by {}", path);
  } catch (const UserError& refusal) {
    return fmt::format("calibration refused: {}", refusal.what());
  }
}

std::string LineOf(const device::UsbListing& device) {
  const std::string serial = device.serial.empty() ? "serial number unknown" : device.serial;
  if (device.bootloader) {
    return fmt::format("  {}  in its bootloader  {}  install firmware with torquer-flash\n", serial,
                       device.path);
  }
  std::string status = device.permitted ? CalibrationOf(device.serial)
                                        : fmt::format("may not be opened by this user; {}",
                                                      device::kPermissionRemedy);
  const auto user = bus::ClaimHolder(DeviceClaimName(device.address + " " + device.serial));
  if (user) status += fmt::format("  read by process {}", *user);
  return fmt::format("  {}  firmware {}  {}  {}\n", serial, device.version, device.path, status);
}

std::string LineOf(const device::InputListing& input) {
  return fmt::format("  {}  {}  {}  ({}){}\n", input.serial, input.is_mouse ? "mouse" : "joystick",
                     input.path, input.name,
                     input.is_mouse ? "  " + CalibrationOf(input.serial) : "");
}

}  // namespace

std::string DeviceList() {
  std::string list = "bench devices, for --source usb --device SERIAL\n";
  const std::vector<device::UsbListing> devices = device::BenchDevicesHere();
  for (const device::UsbListing& device : devices) list += LineOf(device);
  if (devices.empty()) list += "  none is plugged in\n";

  list += "mice and joysticks, for --source evdev --device PATH\n";
  const std::vector<device::InputListing> inputs = device::InputsHere();
  for (const device::InputListing& input : inputs) list += LineOf(input);
  if (inputs.empty()) {
    list +=
        "  none that this user may read; join the group that may: sudo usermod -aG input $USER\n";
  }
  return list;
}

}  // namespace torquer::daemon
