#include "host/device/sensor_picture.h"

#include <iterator>

#include "host/device/report_copy.h"

namespace torquer::device {

SensorPicture TakeSensorPicture(FeatureReports& reports) {
  protocol::PictureReport report;
  try {
    report = GetReport<protocol::PictureReport>(reports, protocol::kPictureReportId);
  } catch (const ReportRefused&) {
    throw UserError(
        "the device has no picture: its sensor does not answer (check its wiring), or its firmware "
        "is "
        "too old for this (run torquer-flash)");
  }
  SensorPicture picture;
  picture.pixels.assign(std::begin(report.pixels), std::end(report.pixels));
  picture.surface_quality = report.surface_quality;
  picture.shutter = report.shutter;
  return picture;
}

}  // namespace torquer::device
