#include "calibration/calibration_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <sstream>
#include <string_view>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::calibration {
namespace {

constexpr char kFormat[] = "torquer-calibration";
constexpr char kEndMarker[] = "[end]\nchecksum = \"";
constexpr char kRemedy[] = "take a new calibration with torquer-calibrate";

std::string Hex(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

// Shortest text that reads back as the same double, and that TOML takes for a float.
std::string Number(double value) {
  char text[32];
  const auto [end, error] = std::to_chars(text, text + sizeof text, value);
  std::string number(text, end);
  if (number.find_first_of(".en") == std::string::npos) number += ".0";
  return number;
}

std::string Pair(const std::array<double, 2>& values) {
  return "[" + Number(values[0]) + ", " + Number(values[1]) + "]";
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
  return std::string("\n[joystick.") + name + "]\ncenter = " + Number(axis.center) +
         "\nminimum = " + Number(axis.minimum) + "\nmaximum = " + Number(axis.maximum) +
         "\ndead_zone = " + Number(axis.dead_zone) +
         "\nfull_rate_rad_per_s = " + Number(axis.full_rate_rad_per_s) + "\n";
}

bool Printable(const std::string& text) {
  for (const char character : text) {
    if (character < ' ' || character > '~') return false;
  }
  return true;
}

// Reads one file's keys, naming file, line and field in every complaint.
class Reader {
 public:
  explicit Reader(const std::string& path) : path_(path) {}

  [[noreturn]] void Refuse(const std::string& problem) const {
    throw UserError(path_ + ": " + problem + "; " + kRemedy);
  }

  [[noreturn]] void RefuseAt(const toml::node& node, const std::string& field,
                             const std::string& problem) const {
    std::ostringstream value;
    node.visit([&](const auto& typed) { value << typed; });
    Refuse("line " + std::to_string(node.source().begin.line) + ", " + field + " = " + value.str() +
           ": " + problem);
  }

  const toml::node& Find(const toml::table& table, const std::string& prefix,
                         const char* key) const {
    const toml::node* node = table.get(key);
    if (node == nullptr) Refuse("the key " + prefix + key + " is missing");
    return *node;
  }

  const toml::table& Table(const toml::table& table, const std::string& prefix,
                           const char* key) const {
    const toml::node& node = Find(table, prefix, key);
    if (!node.is_table()) RefuseAt(node, prefix + key, "not a table");
    return *node.as_table();
  }

  std::string Text(const toml::table& table, const std::string& prefix, const char* key) const {
    const toml::node& node = Find(table, prefix, key);
    const auto value = node.value_exact<std::string>();
    if (!value) RefuseAt(node, prefix + key, "not a text");
    if (!Printable(*value)) RefuseAt(node, prefix + key, "not printable ASCII");
    return *value;
  }

  double Double(const toml::table& table, const std::string& prefix, const char* key, double lowest,
                double highest) const {
    return InRange(Find(table, prefix, key), prefix + key, lowest, highest);
  }

  std::array<double, 2> Pair(const toml::table& table, const std::string& prefix, const char* key,
                             double lowest, double highest) const {
    const toml::node& node = Find(table, prefix, key);
    const toml::array* array = node.as_array();
    if (array == nullptr || array->size() != 2) {
      RefuseAt(node, prefix + key, "not a pair of numbers [axial, transverse]");
    }
    return {InRange((*array)[0], prefix + key, lowest, highest),
            InRange((*array)[1], prefix + key, lowest, highest)};
  }

  void NoOtherKeys(const toml::table& table, const std::string& prefix,
                   std::initializer_list<std::string_view> known) const {
    for (const auto& [key, node] : table) {
      if (std::find(known.begin(), known.end(), key.str()) == known.end()) {
        Refuse("line " + std::to_string(key.source().begin.line) + ": unknown key " + prefix +
               std::string(key.str()));
      }
    }
  }

 private:
  double InRange(const toml::node& node, const std::string& field, double lowest,
                 double highest) const {
    const auto value = node.value<double>();
    if (!node.is_number() || !value) RefuseAt(node, field, "not a number");
    // Written so that NaN fails.
    if (!(*value >= lowest && *value <= highest)) {
      RefuseAt(node, field, "not from " + Number(lowest) + " to " + Number(highest));
    }
    return *value;
  }

  const std::string& path_;
};

JoystickAxis ReadAxis(const Reader& reader, const toml::table& joystick, const char* name) {
  const toml::table& table = reader.Table(joystick, "joystick.", name);
  const std::string prefix = std::string("joystick.") + name + ".";
  reader.NoOtherKeys(table, prefix,
                     {"center", "minimum", "maximum", "dead_zone", "full_rate_rad_per_s"});
  JoystickAxis axis;
  axis.center = reader.Double(table, prefix, "center", 0.0, 1023.0);
  axis.minimum = reader.Double(table, prefix, "minimum", 0.0, 1023.0);
  axis.maximum = reader.Double(table, prefix, "maximum", 0.0, 1023.0);
  axis.dead_zone = reader.Double(table, prefix, "dead_zone", 0.0, 511.0);
  axis.full_rate_rad_per_s = reader.Double(table, prefix, "full_rate_rad_per_s", 0.001, 10.0);
  if (axis.minimum >= axis.center - axis.dead_zone ||
      axis.maximum <= axis.center + axis.dead_zone) {
    reader.RefuseAt(reader.Find(table, prefix, "dead_zone"), prefix + "dead_zone",
                    "the extremes are not outside the dead zone around the center");
  }
  return axis;
}

// Larger than any sensor's step: a tenth of a mm a count is 254 counts an inch.
constexpr double kGainLimit = 1.0;

MotionModel ReadMotion(const Reader& reader, const toml::table& root) {
  const toml::table& table = reader.Table(root, "", "motion");
  const std::string prefix = "motion.";
  reader.NoOtherKeys(table, prefix,
                     {"cpi", "insertion_mm_per_count", "rotation_rad_per_count",
                      "insertion_standard_error", "rotation_standard_error"});
  MotionModel model;
  const toml::node& cpi = reader.Find(table, prefix, "cpi");
  if (!cpi.is_integer()) reader.RefuseAt(cpi, "motion.cpi", "not a whole number");
  model.cpi = static_cast<int>(reader.Double(table, prefix, "cpi", 1.0, 60000.0));
  model.per_count[0] =
      reader.Pair(table, prefix, "insertion_mm_per_count", -kGainLimit, kGainLimit);
  model.per_count[1] =
      reader.Pair(table, prefix, "rotation_rad_per_count", -kGainLimit, kGainLimit);
  model.standard_error[0] = reader.Pair(table, prefix, "insertion_standard_error", 0.0, kGainLimit);
  model.standard_error[1] = reader.Pair(table, prefix, "rotation_standard_error", 0.0, kGainLimit);
  const Matrix2& m = model.per_count;
  const double area = std::abs(m[0][0] * m[1][1] - m[0][1] * m[1][0]);
  const double lengths = std::hypot(m[0][0], m[0][1]) * std::hypot(m[1][0], m[1][1]);
  if (!(area > 0.01 * lengths)) {
    reader.RefuseAt(reader.Find(table, prefix, "rotation_rad_per_count"),
                    "motion.rotation_rad_per_count",
                    "parallel to motion.insertion_mm_per_count, so that pushing and turning "
                    "cannot be told apart");
  }
  return model;
}

}  // namespace

std::string FormatCalibration(const Calibration& calibration) {
  const MotionModel& motion = calibration.motion;
  std::string text =
      "# What turns this device's counts into motion. Written by torquer-calibrate;\n"
      "# the last line guards every byte above it.\n";
  text += std::string("format = \"") + kFormat + "\"\n";
  text += "version = " + std::to_string(kCalibrationFileVersion) + "\n";
  text += "device = " + Quoted(calibration.device) + "\n";
  text += "note = " + Quoted(calibration.note) + "\n";
  text += "\n# Pairs: [of one axial count, of one transverse count].\n[motion]\n";
  text += "cpi = " + std::to_string(motion.cpi) + "\n";
  text += "insertion_mm_per_count = " + Pair(motion.per_count[0]) + "\n";
  text += "rotation_rad_per_count = " + Pair(motion.per_count[1]) + "\n";
  text += "insertion_standard_error = " + Pair(motion.standard_error[0]) + "\n";
  text += "rotation_standard_error = " + Pair(motion.standard_error[1]) + "\n";
  text += FormatAxis("lao", calibration.lao) + FormatAxis("cra", calibration.cra) + "\n";
  const std::string checksum = Hex(Fnv1a(text));
  return text + kEndMarker + checksum + "\"\n";
}

Calibration ParseCalibration(const std::string& text, const std::string& path) {
  const Reader reader(path);
  toml::table root;
  try {
    root = toml::parse(text);
  } catch (const toml::parse_error& error) {
    reader.Refuse("line " + std::to_string(error.source().begin.line) +
                  ": torn, or not TOML: " + std::string(error.description()));
  }
  if (root["format"].value_or(std::string()) != kFormat) {
    reader.Refuse("not a Torquer calibration: it has no line 'format = \"" + std::string(kFormat) +
                  "\"'");
  }
  const toml::node& version = reader.Find(root, "", "version");
  if (version.value_exact<std::int64_t>().value_or(0) != kCalibrationFileVersion) {
    reader.RefuseAt(version, "version",
                    "this program reads version " + std::to_string(kCalibrationFileVersion) +
                        " only; use the program that wrote it, or");
  }
  const std::size_t end = text.rfind(kEndMarker);
  if (end == std::string::npos) {
    reader.Refuse("torn: the end of the file with its checksum is missing");
  }
  const std::string ending =
      kEndMarker + Hex(Fnv1a(std::string_view(text).substr(0, end))) + "\"\n";
  if (text.substr(end) != ending) {
    reader.Refuse("torn or edited: the checksum in its last line is not that of the lines above");
  }

  reader.NoOtherKeys(root, "",
                     {"format", "version", "device", "note", "motion", "joystick", "end"});
  Calibration calibration;
  calibration.device = reader.Text(root, "", "device");
  calibration.note = reader.Text(root, "", "note");
  calibration.motion = ReadMotion(reader, root);
  const toml::table& joystick = reader.Table(root, "", "joystick");
  reader.NoOtherKeys(joystick, "joystick.", {"lao", "cra"});
  calibration.lao = ReadAxis(reader, joystick, "lao");
  calibration.cra = ReadAxis(reader, joystick, "cra");
  return calibration;
}

Calibration ReadCalibration(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw UserError(path + ": cannot be read: " + std::strerror(errno) + "; " + kRemedy +
                    ", or run with --uncalibrated");
  }
  const std::string text((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  return ParseCalibration(text, path);
}

void RequireDevice(const Calibration& calibration, const std::string& path,
                   const std::string& device) {
  if (calibration.device == device) return;
  throw UserError(path + ": device = '" + calibration.device + "', but the device here is '" +
                  device + "'; " + kRemedy + ", or give that device's file with --calibration");
}

std::string CalibrationPath(const std::string& device) {
  const char* config = std::getenv("XDG_CONFIG_HOME");
  const char* home = std::getenv("HOME");
  std::string folder;
  if (config != nullptr && config[0] == '/') {
    folder = config;
  } else if (home != nullptr && home[0] == '/') {
    folder = std::string(home) + "/.config";
  } else {
    throw UserError(
        "neither XDG_CONFIG_HOME nor HOME names a folder for calibrations; name the file instead");
  }
  // A slash would leave the folder, and so would a name of dots alone.
  std::string name;
  for (const char character : device) {
    const bool plain = std::isalnum(static_cast<unsigned char>(character)) != 0 ||
                       character == '-' || character == '_' || (character == '.' && !name.empty());
    name += plain ? character : '_';
  }
  return folder + "/torquer/" + (name.empty() ? "_" : name) + ".toml";
}

void WriteCalibration(const Calibration& calibration, const std::string& path) {
  const std::string text = FormatCalibration(calibration);
  ParseCalibration(text, path);  // what could not be read back is not written
  WriteFileAtomically(path, text);
}

}  // namespace torquer::calibration
