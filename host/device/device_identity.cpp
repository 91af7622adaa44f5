#include "host/device/device_identity.h"

#include <fmt/format.h>

#include <cstring>
#include <vector>

#include "host/support/error.h"
#include "protocol/hid_reports.h"
#include "protocol/lcm_channels.h"

namespace torquer::device {

namespace {

// A device that has just been plugged in, or a busy host, may miss one.
constexpr int kMostTimeouts = 2;

std::vector<std::uint8_t> AskForIdentity(ReportSource& source) {
  for (int timeouts = 0;; ++timeouts) {
    try {
      return source.GetFeature(protocol::kIdentityReportId);
    } catch (const FeatureTimeout&) {
      if (timeouts == kMostTimeouts) throw;
    }
  }
}

}  // namespace

DeviceIdentity ReadIdentity(ReportSource& source) {
  const std::vector<std::uint8_t> answer = AskForIdentity(source);
  if (answer.size() >= 2 && answer[1] != protocol::kProtocolVersion) {
    throw UserError(
        fmt::format("the device's firmware has protocol version {}, this program has {}; {}",
                    answer[1], protocol::kProtocolVersion, kFlashRemedy));
  }
  if (answer.size() != sizeof(protocol::IdentityReport)) {
    throw UserError(fmt::format("the device's identity has {} bytes instead of {}; {}",
                                answer.size(), sizeof(protocol::IdentityReport), kFlashRemedy));
  }
  protocol::IdentityReport identity;
  std::memcpy(&identity, answer.data(), sizeof identity);
  DeviceIdentity found;
  found.serial.assign(identity.serial, strnlen(identity.serial, sizeof identity.serial));
  for (char& character : found.serial) {
    if (character < ' ' || character > '~') character = '?';
  }
  found.has_second_sensor = (identity.capabilities & protocol::kCapabilitySecondSensor) != 0;
  std::uint8_t product_id = identity.sensor_product_id;
  if (source.sensor() == 2) {
    if (!found.has_second_sensor) {
      throw UserError(
          fmt::format("the device '{}' has one sensor, and none for a second instrument; leave out "
                      "--second-instrument and --sensor 2, or build the box with two sensors "
                      "(hardware/README.md)",
                      found.serial));
    }
    found.serial = protocol::SecondSerial(found.serial);
    product_id = identity.second_product_id;
  }
  if (product_id != 0) found.sensor_product_id = product_id;
  return found;
}

}  // namespace torquer::device
