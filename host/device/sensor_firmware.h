// Loads the firmware image (SROM) of the motion sensor's maker from the user's file into the
// sensor.
//
// The image is the maker's property and not part of this project. The sensor also works without it.
// The sensor loses the image without power, so a program loads it each time. `torquer-flash --srom`
// keeps the copy for the device.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host/device/feature_reports.h"

namespace torquer::device {

/// The image in a file: protocol::kSromBytes bytes. Throws UserError naming the file, its contents,
/// and the remedy.
std::vector<std::uint8_t> ReadSromFile(const std::string& path);

/// Loads `image` into the device's sensor in about 0.3 s. Returns the number that the sensor
/// reports, never 0. Throws UserError with the cause and the remedy if the sensor refuses the
/// image; the sensor then runs its ROM.
int LoadSrom(FeatureReports& reports, const std::vector<std::uint8_t>& image);

/// Number of the image that the sensor runs now; 0: its ROM.
int RunningSrom(FeatureReports& reports);

/// Path of the kept image for the device with this serial number: SERIAL.srom, beside its
/// calibration. Returns nullopt if the user has no configuration folder.
std::optional<std::string> KeptSromPath(const std::string& serial);

/// Keeps a copy of `image` there, so that the daemon loads it whenever the sensor has lost it.
/// Returns its path, or nullopt if the user has no configuration folder. Throws UserError when it
/// cannot be written.
std::optional<std::string> KeepSrom(const std::string& serial,
                                    const std::vector<std::uint8_t>& image);

}  // namespace torquer::device
