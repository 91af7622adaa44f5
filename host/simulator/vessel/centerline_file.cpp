#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/curve_limits.h"
#include "host/support/error.h"
#include "host/support/input_file.h"

namespace torquer::vessel {

using Eigen::Vector3d;
using nlohmann::json;

namespace {

constexpr const char* kMarkupsEnding = ".mrk.json";

[[noreturn]] void RefuseFile(const std::string& path, const std::string& what) {
  throw UserError(path + ": " + what);
}

// Member of an object. A missing one is refused, named by its place in the file.
const json& Member(const std::string& path, const json& object, const std::string& where,
                   const char* name) {
  const auto found = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || found == object.end()) {
    RefuseFile(path,
               "field " + where + name + " is missing; save the curve as Markups from 3D Slicer");
  }
  return *found;
}

// Text of a value for a message. Nested values are not written out: a file can nest deeper than the
// stack.
std::string Shown(const json& value) {
  const auto nested = [](const json& item) { return item.is_structured(); };
  if (value.is_structured() && std::any_of(value.begin(), value.end(), nested)) return "nested";
  return value.dump();
}

double NumberAt(const std::string& path, const json& value, const std::string& where) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(number)) {
    RefuseFile(path,
               "field " + where + " is " + Shown(value) + ", not a finite number; repair the file");
  }
  return number;
}

CurveFile ReadCurveFile(const std::string& path) {
  return {path, ReadInputFile(path, "check the path of the centerline, and its permissions")};
}

}  // namespace

Centerline ParseSlicerCurve(const CurveFile& file, double mm_per_unit) {
  const std::string& path = file.path;
  json document;
  try {
    document = json::parse(file.contents);
  } catch (const json::exception& e) {
    RefuseFile(path, std::string("not valid JSON (") + e.what() +
                         "); the file is damaged or cut short: save it again from 3D Slicer");
  }
  const json& markups = Member(path, document, "", "markups");
  if (!markups.is_array() || markups.size() != 1) {
    RefuseFile(path, "field markups holds " +
                         std::to_string(markups.is_array() ? markups.size() : 0) +
                         " curves; save exactly one curve per file");
  }
  const std::string where = "markups[0].";
  const json& markup = markups[0];
  const json& type = Member(path, markup, where, "type");
  if (type != "Curve") {
    RefuseFile(path,
               "field " + where + "type is " + Shown(type) + "; save the markup as \"Curve\"");
  }
  const auto units = markup.find("coordinateUnits");
  if (units != markup.end() && *units != "mm") {
    RefuseFile(path, "field " + where + "coordinateUnits is " + Shown(*units) +
                         "; save the curve in \"mm\"");
  }
  const json& controls = Member(path, markup, where, "controlPoints");
  if (!controls.is_array())
    RefuseFile(path, "field " + where +
                         "controlPoints is not a list; save the curve again from 3D Slicer");
  std::vector<Vector3d> points;
  std::vector<size_t> used;
  for (size_t i = 0; i < controls.size(); ++i) {
    const std::string at = where + "controlPoints[" + std::to_string(i) + "].";
    // Slicer keeps points that were never placed.
    const auto status = controls[i].find("positionStatus");
    if (status != controls[i].end() && *status != "defined") continue;
    const json& position = Member(path, controls[i], at, "position");
    if (!position.is_array() || position.size() != 3) {
      RefuseFile(path, "field " + at + "position is " + Shown(position) +
                           "; it must be a list of three numbers");
    }
    Vector3d point;
    for (int a = 0; a < 3; ++a) {
      point[a] =
          mm_per_unit * NumberAt(path, position[a], at + "position[" + std::to_string(a) + "]");
    }
    points.push_back(point);
    used.push_back(i);
  }
  const json& measurements = Member(path, markup, where, "measurements");
  const json* radius = nullptr;
  for (const json& measurement : measurements) {
    const auto called = measurement.is_object() ? measurement.find("name") : measurement.end();
    if (called != measurement.end() && *called == "Radius") radius = &measurement;
  }
  if (radius == nullptr) {
    RefuseFile(path, "field " + where +
                         "measurements has no \"Radius\"; compute the curve with radii (Extract "
                         "Centerline in 3D Slicer does)");
  }
  const std::string values_at = where + "measurements[\"Radius\"].";
  const json& values = Member(path, *radius, values_at, "controlPointValues");
  if (!values.is_array() || values.size() != controls.size()) {
    RefuseFile(path, "field " + values_at + "controlPointValues has " +
                         std::to_string(values.size()) + " entries for " +
                         std::to_string(controls.size()) +
                         " control points; compute the radii again");
  }
  std::vector<double> radii;
  for (const size_t i : used) {
    const std::string at = values_at + "controlPointValues[" + std::to_string(i) + "]";
    const double value = mm_per_unit * NumberAt(path, values[i], at);
    if (value < 0)
      RefuseFile(path, "field " + at + " is " + values[i].dump() + "; a radius must be 0 or more");
    radii.push_back(value);
  }
  std::string name = std::filesystem::path(path).filename().string();
  if (name.size() > std::string(kMarkupsEnding).size() && name.ends_with(kMarkupsEnding)) {
    name.resize(name.size() - std::string(kMarkupsEnding).size());
  }
  try {
    return Centerline(name, points, radii);
  } catch (const UserError& e) {
    RefuseFile(path, e.what());
  }
}

std::vector<CurveFile> ReadCurveFiles(const std::string& folder) {
  std::error_code error;
  std::vector<std::string> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().filename().string().ends_with(kMarkupsEnding))
      paths.push_back(entry.path().string());
  }
  if (error) {
    throw UserError(folder + ": the folder of centerlines cannot be read (" + error.message() +
                    "); check the path");
  }
  if (paths.empty()) {
    throw UserError(folder + ": the folder holds no " + kMarkupsEnding +
                    " file; save the centerlines as Markups from 3D Slicer");
  }
  if (paths.size() > kMostCurves) {
    throw UserError(folder + ": the folder holds " + std::to_string(paths.size()) + " " +
                    kMarkupsEnding + " files; a vessel has at most " + std::to_string(kMostCurves) +
                    " centerlines: remove unused files from the folder");
  }
  std::sort(paths.begin(), paths.end());
  std::vector<CurveFile> files;
  for (const std::string& path : paths) files.push_back(ReadCurveFile(path));
  return files;
}

CenterlineNetwork ParseSlicerCurves(const std::vector<CurveFile>& files, double mm_per_unit) {
  std::vector<Centerline> curves;
  for (const CurveFile& file : files) curves.push_back(ParseSlicerCurve(file, mm_per_unit));
  return CenterlineNetwork(std::move(curves));
}

}  // namespace torquer::vessel
