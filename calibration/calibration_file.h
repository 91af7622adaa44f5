// A calibration on disk: TOML, versioned, tied to a device, whole or not there.
//
// The last line carries a checksum of all bytes before it, so that a torn or edited file is known
// for one. Format and its versions: README.md beside this file.
#pragma once

#include <optional>
#include <string>

#include "calibration/motion_model.h"

namespace torquer::calibration {

/// Version of the file format; files of a later version are refused, there is no earlier one.
inline constexpr int kCalibrationFileVersion = 1;

/// Exactly what WriteCalibration() puts into the file.
std::string FormatCalibration(const Calibration& calibration);

/// The calibration in `text`; `path` is for messages only. Throws UserError naming the file, line
/// or field, value and remedy when the text is no calibration, is of a newer version, is torn or
/// was edited, or holds a value out of range or a key it should not.
Calibration ParseCalibration(const std::string& text, const std::string& path);

/// Reads and checks a file. Throws UserError as ParseCalibration() does, or when it cannot be read.
Calibration ReadCalibration(const std::string& path);

/// Throws UserError unless `calibration` (read from `path`) was taken on `device`.
void RequireDevice(const Calibration& calibration, const std::string& path,
                   const std::string& device);

/// Throws UserError if `calibration` (read from `path`) was taken with another sensor. An unknown
/// sensor, there or here, is accepted.
void RequireSensor(const Calibration& calibration, const std::string& path,
                   std::optional<int> sensor_product_id);

/// Default path of the calibration of `device`: a file named after its serial number in the user's
/// configuration folder. Throws UserError when there is no such folder.
std::string CalibrationPath(const std::string& device);

/// Replaces `path` in one step: on any failure the file holds either the old calibration or the
/// new one. Throws UserError when the calibration is out of range or the file cannot be
/// written.
void WriteCalibration(const Calibration& calibration, const std::string& path);

}  // namespace torquer::calibration
