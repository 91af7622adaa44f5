#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/curve_limits.h"
#include "host/simulator/vessel/length_unit.h"
#include "host/simulator/vessel/patient_space.h"
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
const json& Member(const std::string& path, const json& object, std::string_view where,
                   const char* name) {
  const auto found = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || found == object.end()) {
    RefuseFile(path, "field " + std::string(where) + name +
                         " is missing; save the curve as Markups from 3D Slicer");
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

// mm per unit of an optional text field; `otherwise` without it.
double MmPerUnit(const std::string& path, const json& object, const std::string& where,
                 const char* name, double otherwise) {
  const auto found = object.find(name);
  if (found == object.end()) return otherwise;
  std::string known;
  for (const LengthUnit& unit : kLengthUnits) {
    if (found->is_string() && found->get_ref<const std::string&>() == unit.name) return unit.mm;
    known += (known.empty() ? "" : ", ") + std::string(unit.name);
  }
  RefuseFile(path,
             "field " + where + name + " is " + Shown(*found) +
                 ", not a known unit of length; save the curve in mm, or name one of: " + known);
}

std::optional<PatientSpace> SpaceOfCurve(const std::string& path, const json& markup,
                                         const std::string& where) {
  const auto found = markup.find("coordinateSystem");
  if (found == markup.end()) return std::nullopt;
  const auto space = found->is_string() ? PatientSpaceOf(found->get_ref<const std::string&>())
                                        : std::optional<PatientSpace>();
  if (!space) {
    RefuseFile(path, "field " + where + "coordinateSystem is " + Shown(*found) +
                         "; save the curve in \"LPS\" or \"RAS\"");
  }
  return space;
}

// The only curve of a file.
const json& CurveMarkup(const std::string& path, const json& document, const std::string& where) {
  const json& markups = Member(path, document, "", "markups");
  if (!markups.is_array() || markups.size() != 1) {
    RefuseFile(path, "field markups holds " +
                         std::to_string(markups.is_array() ? markups.size() : 0) +
                         " curves; save exactly one curve per file");
  }
  const json& type = Member(path, markups[0], where, "type");
  if (type != "Curve") {
    RefuseFile(path,
               "field " + where + "type is " + Shown(type) + "; save the markup as \"Curve\"");
  }
  return markups[0];
}

// Points that were placed, in mm, and their numbers among all.
struct PlacedPoints {
  std::vector<Vector3d> at_mm;
  std::vector<size_t> numbers;
  size_t all = 0;
};

PlacedPoints ReadPoints(const std::string& path, const json& markup, const std::string& where,
                        double mm_per_unit) {
  const json& controls = Member(path, markup, where, "controlPoints");
  if (!controls.is_array())
    RefuseFile(path, "field " + where +
                         "controlPoints is not a list; save the curve again from 3D Slicer");
  PlacedPoints points;
  points.all = controls.size();
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
    points.at_mm.push_back(point);
    points.numbers.push_back(i);
  }
  return points;
}

std::vector<double> ReadRadii(const std::string& path, const json& markup, const std::string& where,
                              const PlacedPoints& points, double mm_per_unit) {
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
  const double mm = MmPerUnit(path, *radius, values_at, "units", mm_per_unit);
  const json& values = Member(path, *radius, values_at, "controlPointValues");
  if (!values.is_array() || values.size() != points.all) {
    RefuseFile(path, "field " + values_at + "controlPointValues has " +
                         std::to_string(values.size()) + " entries for " +
                         std::to_string(points.all) + " control points; compute the radii again");
  }
  std::vector<double> radii;
  for (const size_t i : points.numbers) {
    const std::string at = values_at + "controlPointValues[" + std::to_string(i) + "]";
    const double value = mm * NumberAt(path, values[i], at);
    if (value < 0)
      RefuseFile(path, "field " + at + " is " + values[i].dump() + "; a radius must be 0 or more");
    radii.push_back(value);
  }
  return radii;
}

std::string CurveName(const std::string& path) {
  std::string name = std::filesystem::path(path).filename().string();
  if (name.size() > std::string(kMarkupsEnding).size() && name.ends_with(kMarkupsEnding)) {
    name.resize(name.size() - std::string(kMarkupsEnding).size());
  }
  return name;
}

// A curve in the space of its surface, if both are known, and the space of its file.
struct ReadCurve {
  Centerline curve;
  std::optional<PatientSpace> space;
};

ReadCurve ParseCurve(const CurveFile& file, std::optional<PatientSpace> surface) {
  const std::string& path = file.path;
  json document;
  try {
    document = json::parse(file.contents);
  } catch (const json::exception& e) {
    RefuseFile(path, std::string("not valid JSON (") + e.what() +
                         "); the file is damaged or cut short: save it again from 3D Slicer");
  }
  const std::string where = "markups[0].";
  const json& markup = CurveMarkup(path, document, where);
  const double mm_per_unit = MmPerUnit(path, markup, where, "coordinateUnits", 1);
  const std::optional<PatientSpace> space = SpaceOfCurve(path, markup, where);
  PlacedPoints points = ReadPoints(path, markup, where, mm_per_unit);
  const std::vector<double> radii = ReadRadii(path, markup, where, points, mm_per_unit);
  if (space && surface && *space != *surface) {
    for (Vector3d& point : points.at_mm) point.head<2>() *= -1;
  }
  try {
    return {Centerline(CurveName(path), points.at_mm, radii), space};
  } catch (const UserError& e) {
    RefuseFile(path, e.what());
  }
}

// Throws if curves of one vessel have different spaces, and the surface names none.
void CheckOneSpace(const std::vector<CurveFile>& files, const std::vector<ReadCurve>& read) {
  for (size_t k = 1; k < read.size(); ++k) {
    if (!read[k].space || !read[0].space || *read[k].space == *read[0].space) continue;
    RefuseFile(files[k].path, std::string("field markups[0].coordinateSystem is \"") +
                                  NameOf(*read[k].space) + "\", but \"" + NameOf(*read[0].space) +
                                  "\" in " + files[0].path +
                                  "; save all curves in the system of the surface");
  }
}

}  // namespace

Centerline ParseSlicerCurve(const CurveFile& file, std::optional<PatientSpace> surface) {
  return ParseCurve(file, surface).curve;
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

CenterlineNetwork ParseSlicerCurves(const std::vector<CurveFile>& files,
                                    std::optional<PatientSpace> surface,
                                    std::vector<std::string>* findings) {
  std::vector<ReadCurve> read;
  for (const CurveFile& file : files) read.push_back(ParseCurve(file, surface));
  if (!surface) CheckOneSpace(files, read);
  std::vector<Centerline> curves;
  for (ReadCurve& one : read) {
    if (findings != nullptr && surface && one.space && *one.space != *surface) {
      findings->push_back("centerline " + one.curve.name() + " is in " + NameOf(*one.space) +
                          " and the surface in " + NameOf(*surface) +
                          ": the signs of its x and y are changed");
    }
    curves.push_back(std::move(one.curve));
  }
  return CenterlineNetwork(std::move(curves));
}

}  // namespace torquer::vessel
