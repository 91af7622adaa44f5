#include "host/emulator/bench_choice.h"

#include <numbers>

#include "host/emulator/firmware_image.h"

namespace torquer::emulator {

void BenchChoice::Complete() {
  options.sensor.misalignment_rad = misalignment_deg * std::numbers::pi / 180.0;
  options.sensor_kind = sensor == "pmw3389" ? SensorKind::kPmw3389 : SensorKind::kPmw3360;
  if (firmware == "none") {
    if (bootloader.empty()) {
      throw UsageError(
          "--firmware none: the device would have no program; give --bootloader, or another "
          "--firmware");
    }
    firmware.clear();
  } else if (firmware.empty()) {
    firmware = FirmwareImage::OfThisBuild();
  }
}

void AddBenchOptions(Options& options, BenchChoice& choice) {
  options.Group("Device");
  options.Text(
      "--firmware", "ELF", choice.firmware,
      "firmware image to run; without it the firmware of this build; none: run only the bootloader",
      ValueKind::kFile);
  options.Text(
      "--bootloader", "ELF", choice.bootloader,
      "bootloader image for the last 2 KiB of the flash; without it the flash has no bootloader",
      ValueKind::kFile);
  options.Text("--serial", "TEXT", choice.options.serial,
               "serial number to write to the EEPROM, 1 to 16 printable characters; without it the "
               "EEPROM stays unchanged");
  options.Choice("--sensor", "PART", {"pmw3360", "pmw3389"}, choice.sensor, "the motion sensor");
  options.Number("--supply-mv", "MV", choice.options.supply_mv, 2700, 5500,
                 "supply of the chip, which the firmware measures");
  options.Number("--cylinder-radius-mm", "MM", choice.options.cylinder_radius_mm, 0.1, 1000,
                 "radius of the cylinder that the sensor observes");
  options.Number("--misalign-deg", "DEG", choice.misalignment_deg, -180, 180,
                 "misalignment angle of the mounted sensor");
  options.Number("--scale", "FACTOR", choice.options.sensor.scale, 0.01, 100,
                 "ratio of the sensor's counts to the nominal counts");
  options.Number("--lens-distance", "MM", choice.options.optics.distance_mm, 0, 20,
                 "distance from the lens to the surface; the sensor is in focus from 2.2 to 2.6");
  options.Number("--height-gain", "SHARE", choice.options.optics.magnification_per_mm, -0.3, 0,
                 "change of the sensor's counts for each millimeter that the surface is farther "
                 "away");
  options.Number("--play", "MM", choice.options.play_mm, 0, 2,
                 "height by which the hand can raise the cylinder in its bore");
  options.Number("--dirt", "SHARE", choice.options.optics.dirt, 0, 1,
                 "fraction of the sensor's field of view that dirt covers");
  options.Number("--lamp-shading", "RATIO", choice.options.optics.lamp_shading, 0.01, 100,
                 "brightness ratio between the ends of the sensor's field of view, along the pipe");
  options.Number("--shading", "RATIO", choice.options.optics.side_shading, 0.01, 100,
                 "brightness ratio between the sides of the sensor's field of view, across the "
                 "pipe");
}

}  // namespace torquer::emulator
