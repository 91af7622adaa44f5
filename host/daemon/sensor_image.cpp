#include "host/daemon/sensor_image.h"

#include <fmt/format.h>

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "host/device/sensor_firmware.h"
#include "host/device/source_reports.h"
#include "host/support/error.h"
#include "protocol/hid_reports.h"

namespace torquer::daemon {

void SensorImage::OnConnected(const std::string& serial) {
  serial_ = serial;
  lost_ = false;
  working_ = false;
  OnReset();
}

void SensorImage::OnReset() {
  tries_left_ = kTries;
  reported_.reset();
}

void SensorImage::OnReport(std::uint8_t flags) {
  const bool lost = (flags & protocol::kFlagSromLost) != 0;
  if (lost && !lost_) OnReset();
  lost_ = lost;
  working_ = (flags & protocol::kFlagSensorFault) == 0;
}

std::optional<std::string> SensorImage::Load(device::ReportSource& source) {
  std::optional<std::string> outcome = Try(source);
  if (outcome == reported_) return std::nullopt;
  reported_ = outcome;
  return outcome;
}

std::optional<std::string> SensorImage::Try(device::ReportSource& source) {
  const int tries_left = std::exchange(tries_left_, 0) - 1;
  const std::optional<std::string> path = device::KeptSromPath(serial_);
  std::error_code unreadable;  // reported by ReadSromFile()
  if (!path || (!std::filesystem::exists(*path, unreadable) && !unreadable)) {
    if (!lost_) return std::nullopt;
    return fmt::format(
        "the sensor has lost its firmware image and works without it, because {} does not exist; "
        "load the image again with torquer-flash --srom FILE, which keeps a copy",
        path.value_or("a copy of it"));
  }
  try {
    device::SourceReports reports(source);
    int id = device::RunningSrom(reports);
    const bool first = tries_left == kTries - 1;
    if (id != 0 && first) return std::nullopt;
    if (id == 0) {  // otherwise the previous try loaded it, but its answer was lost
      const std::vector<std::uint8_t> image = device::ReadSromFile(*path);
      tries_left_ = tries_left;
      id = device::LoadSrom(reports, image);
      tries_left_ = 0;
    }
    ++loaded_;
    return fmt::format("the sensor runs firmware image {} again, from {}", id, *path);
  } catch (const device::DeviceGone&) {
    throw;
  } catch (const UserError& error) {
    return fmt::format("firmware image {} is not in the sensor, which works without it: {}", *path,
                       error.what());
  } catch (const device::ReportRefused& error) {
    tries_left_ = tries_left;
    return fmt::format(
        "firmware image {} is not in the sensor: the device does not report its state ({}); {}",
        *path, error.what(), "run torquer-flash");
  }
}

}  // namespace torquer::daemon
