#include "calibration/calibration_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/input_file.h"
#include "host/support/strict_toml.h"
#include "host/support/user_paths.h"

namespace torquer::calibration {
namespace {

constexpr char kFormat[] = "torquer-calibration";
constexpr char kEndMarker[] = "[end]\nchecksum = \"";
constexpr char kRemedy[] = "take a new calibration with torquer-calibrate";

// Larger than any sensor's step: a tenth of a mm a count is 254 counts an inch.
constexpr double kGainLimit = 1.0;

// Shortest text that reads back as the same double, and that TOML takes for a float.
std::string Number(double value) {
  std::string number = fmt::to_string(value);
  if (number.find_first_of(".en") == std::string::npos) number += ".0";
  return number;
}

std::string Pair(const std::array<double, 2>& values) {
  return fmt::format("[{}, {}]", Number(values[0]), Number(values[1]));
}

// A TOML basic string; the reader accepts printable ASCII only.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char character : text) {
    if (character == '"' || character == '\\') quoted += '\\';
    quoted += character;
  }
  return quoted + '"';
}

std::string FormatAxis(const char* name, const JoystickAxis& axis) {
  return fmt::format(
      "\n[joystick.{}]\ncenter = {}\nminimum = {}\nmaximum = {}\ndead_zone = {}\n"
      "full_rate_rad_per_s = {}\n",
      name, Number(axis.center), Number(axis.minimum), Number(axis.maximum), Number(axis.dead_zone),
      Number(axis.full_rate_rad_per_s));
}

std::string ReadPrintable(StrictTable& table, const char* key) {
  const std::string text = table.AnyText(key);
  if (std::any_of(text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; })) {
    table.Refuse(key, "is not printable ASCII");
  }
  return text;
}

std::array<double, 2> ReadPair(StrictTable& table, const char* key, double lowest, double highest) {
  const std::vector<double> values = table.Numbers(key, lowest, highest);
  if (values.size() != 2) table.Refuse(key, "is not a pair of numbers [axial, transverse]");
  return {values[0], values[1]};
}

JoystickAxis ReadAxis(StrictTable& table) {
  JoystickAxis axis;
  axis.center = table.Number("center", 0.0, 1023.0);
  axis.minimum = table.Number("minimum", 0.0, 1023.0);
  axis.maximum = table.Number("maximum", 0.0, 1023.0);
  axis.dead_zone = table.Number("dead_zone", 0.0, 511.0);
  axis.full_rate_rad_per_s = table.Number("full_rate_rad_per_s", 0.001, 10.0);
  if (axis.minimum >= axis.center - axis.dead_zone ||
      axis.maximum <= axis.center + axis.dead_zone) {
    table.Refuse("dead_zone", "the extremes are not outside the dead zone around the center");
  }
  return axis;
}

MotionModel ReadMotion(StrictTable& table) {
  MotionModel model;
  model.cpi = table.Integer("cpi", 1, 60000);
  model.per_count[0] = ReadPair(table, "insertion_mm_per_count", -kGainLimit, kGainLimit);
  model.per_count[1] = ReadPair(table, "rotation_rad_per_count", -kGainLimit, kGainLimit);
  model.standard_error[0] = ReadPair(table, "insertion_standard_error", 0.0, kGainLimit);
  model.standard_error[1] = ReadPair(table, "rotation_standard_error", 0.0, kGainLimit);
  const Matrix2& m = model.per_count;
  const double area = std::abs(m[0][0] * m[1][1] - m[0][1] * m[1][0]);
  const double lengths = std::hypot(m[0][0], m[0][1]) * std::hypot(m[1][0], m[1][1]);
  if (!(area > 0.01 * lengths)) {
    table.Refuse("rotation_rad_per_count",
                 "parallel to motion.insertion_mm_per_count, so that pushing and turning cannot be "
                 "distinguished");
  }
  return model;
}

// The checksum at the end reveals a truncated or edited file.
void CheckEnd(const std::string& text, const std::string& path) {
  const std::size_t end = text.rfind(kEndMarker);
  if (end == std::string::npos) {
    throw UserError(
        fmt::format("{}: incomplete: the end of the file with its checksum is missing", path));
  }
  const std::string ending =
      fmt::format("{}{}\"\n", kEndMarker, Hex(Fnv1a(std::string_view(text).substr(0, end))));
  if (text.substr(end) != ending) {
    throw UserError(fmt::format(
        "{}: incomplete or edited: the checksum in its last line is not that of the lines above",
        path));
  }
}

Calibration ReadTable(const std::string& text, const std::string& path) {
  StrictTable root = StrictTable::Parse(text, path);
  if (!root.IsText("format") || root.AnyText("format") != kFormat) {
    throw UserError(fmt::format("{}: not a Torquer calibration: it has no line 'format = \"{}\"'",
                                path, kFormat));
  }
  if (root.Integer("version", 0, 1000000) != kCalibrationFileVersion) {
    root.Refuse("version", fmt::format("this program reads version {} only; use the program that "
                                       "wrote it",
                                       kCalibrationFileVersion));
  }
  CheckEnd(text, path);
  root.Table("end").Text("checksum");

  Calibration calibration;
  calibration.device = ReadPrintable(root, "device");
  calibration.note = ReadPrintable(root, "note");
  if (root.Has("sensor")) calibration.sensor_product_id = root.Integer("sensor", 1, 255);
  calibration.motion = ReadMotion(root.Table("motion"));
  StrictTable& joystick = root.Table("joystick");
  calibration.lao = ReadAxis(joystick.Table("lao"));
  calibration.cra = ReadAxis(joystick.Table("cra"));
  root.RefuseUnread();
  return calibration;
}

}  // namespace

std::string FormatCalibration(const Calibration& calibration) {
  const MotionModel& motion = calibration.motion;
  const std::string sensor = calibration.sensor_product_id
                                 ? fmt::format("sensor = {:#04x}\n", *calibration.sensor_product_id)
                                 : std::string();
  const std::string text = fmt::format(
      "# Factors from this device's counts to motion. Written by torquer-calibrate;\n"
      "# the last line guards every byte above it.\n"
      "format = \"{}\"\nversion = {}\ndevice = {}\nnote = {}\n{}"
      "\n# Pairs: [of one axial count, of one transverse count].\n[motion]\n"
      "cpi = {}\n"
      "insertion_mm_per_count = {}\nrotation_rad_per_count = {}\n"
      "insertion_standard_error = {}\nrotation_standard_error = {}\n"
      "{}{}\n",
      kFormat, kCalibrationFileVersion, Quoted(calibration.device), Quoted(calibration.note),
      sensor, motion.cpi, Pair(motion.per_count[0]), Pair(motion.per_count[1]),
      Pair(motion.standard_error[0]), Pair(motion.standard_error[1]),
      FormatAxis("lao", calibration.lao), FormatAxis("cra", calibration.cra));
  return fmt::format("{}{}{}\"\n", text, kEndMarker, Hex(Fnv1a(text)));
}

Calibration ParseCalibration(const std::string& text, const std::string& path) {
  try {
    return ReadTable(text, path);
  } catch (const UserError& error) {
    throw UserError(fmt::format("{}; {}", error.what(), kRemedy));
  }
}

Calibration ReadCalibration(const std::string& path) {
  return ParseCalibration(
      ReadInputFile(path, fmt::format("{}, or run with --uncalibrated", kRemedy)), path);
}

void RequireDevice(const Calibration& calibration, const std::string& path,
                   const std::string& device) {
  if (calibration.device == device) return;
  throw UserError(fmt::format(
      "{}: device = '{}', but the device here is '{}'; {}, or give that device's file with "
      "--calibration",
      path, calibration.device, device, kRemedy));
}

void RequireSensor(const Calibration& calibration, const std::string& path,
                   std::optional<int> sensor_product_id) {
  if (!calibration.sensor_product_id || !sensor_product_id) return;
  if (*calibration.sensor_product_id == *sensor_product_id) return;
  throw UserError(
      fmt::format("{}: sensor = {:#04x}, but the device's sensor is {:#04x} now, whose "
                  "counts differ; {}",
                  path, *calibration.sensor_product_id, *sensor_product_id, kRemedy));
}

std::string CalibrationPath(const std::string& device) {
  const std::optional<std::string> path = DeviceFilePath(device, ".toml");
  if (!path) {
    throw UserError(
        "neither XDG_CONFIG_HOME nor HOME names a folder for calibrations; name the file instead");
  }
  return *path;
}

void WriteCalibration(const Calibration& calibration, const std::string& path) {
  const std::string text = FormatCalibration(calibration);
  ParseCalibration(text, path);  // a text that cannot be read back is not written
  WriteFileAtomically(path, text);
}

}  // namespace torquer::calibration
