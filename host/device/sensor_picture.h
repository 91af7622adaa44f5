// Picture from the motion sensor's camera, for the person who assembles the device.
#pragma once

#include <cstdint>
#include <vector>

#include "host/device/feature_reports.h"

namespace torquer::device {

struct SensorPicture {
  /// protocol::kPictureSide rows of kPictureSide pixels, 0 .. 127, in the sensor's order.
  std::vector<std::uint8_t> pixels;
  int surface_quality = 0;  ///< SQUAL before the picture, 0 .. 128
  int shutter = 0;          ///< exposure before it, sensor clock ticks
};

/// Takes a picture in up to 0.4 s. Meanwhile the device reports a sensor fault. The sensor loses a
/// loaded firmware image. Throws UserError with cause and remedy.
SensorPicture TakeSensorPicture(FeatureReports& reports);

}  // namespace torquer::device
