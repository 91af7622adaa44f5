#include "host/emulator/bench_choice.h"

#include <numbers>

#include "host/emulator/atmega32u4.h"

namespace torquer::emulator {

void BenchChoice::Complete() {
  options.sensor.misalignment_rad = misalignment_deg * std::numbers::pi / 180.0;
  if (firmware == "none") {
    if (bootloader.empty()) {
      throw UsageError("--firmware none: nothing would run; give a --bootloader, or firmware");
    }
    firmware.clear();
  } else if (firmware.empty()) {
    firmware = FirmwareImage::OfThisBuild();
  }
}

void AddBenchOptions(Options& options, BenchChoice& choice) {
  options.Group("Device");
  options.Text("--firmware", "ELF", choice.firmware,
               "firmware to run; without it that of this build; none: no firmware, only the "
               "bootloader",
               ValueKind::kFile);
  options.Text("--bootloader", "ELF", choice.bootloader,
               "bootloader in the last 2 KiB of the flash; without it none", ValueKind::kFile);
  options.Text(
      "--serial", "TEXT", choice.options.serial,
      "serial number in the EEPROM, 1 to 16 printable characters; without it as the EEPROM "
      "is");
  options.Number("--cylinder-radius-mm", "MM", choice.options.cylinder_radius_mm, 0.1, 1000,
                 "radius of the cylinder that the sensor looks at");
  options.Number("--misalign-deg", "DEG", choice.misalignment_deg, -180, 180,
                 "angle by which the sensor is mounted askew");
  options.Number("--scale", "FACTOR", choice.options.sensor.scale, 0.01, 100,
                 "counts of the sensor over what they should be");
  options.Number("--lens-distance", "MM", choice.options.optics.distance_mm, 0, 20,
                 "lens to surface; 2.2 to 2.6 is in focus");
  options.Number("--dirt", "SHARE", choice.options.optics.dirt, 0, 1,
                 "share of the sensor's view that dirt covers");
  options.Number("--shading", "RATIO", choice.options.optics.shading, 1, 100,
                 "brightness of one edge of the sensor's view over that of the other");
}

}  // namespace torquer::emulator
