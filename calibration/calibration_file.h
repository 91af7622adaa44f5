// Calibration file: versioned TOML for one device, written in one step.
//
// The last line is a checksum of all bytes before it, which reveals a truncated or edited file.
// README.md beside this file has the format and its versions.
#pragma once

#include <optional>
#include <string>

#include "calibration/motion_model.h"

namespace torquer::calibration {

/// Version of the file format, the first one. Files of a later version are refused.
inline constexpr int kCalibrationFileVersion = 1;

/// Exactly what WriteCalibration() puts into the file.
std::string FormatCalibration(const Calibration& calibration);

/// The calibration in `text`; `path` is for messages only. Throws UserError if the text is not a
/// calibration, has a newer version, or was truncated or edited. Also throws for an unknown key and
/// a value out of range. The message names the file, line or field, value and remedy.
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
/// configuration folder. Throws UserError if the user has no such folder.
std::string CalibrationPath(const std::string& device);

/// Replaces `path` in one step: on any failure the file holds either the old calibration or the
/// new one. Throws UserError when the calibration is out of range or the file cannot be
/// written.
void WriteCalibration(const Calibration& calibration, const std::string& path);

}  // namespace torquer::calibration
