#include "host/api/control_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "host/simulator/effects/effect.h"

namespace torquer {

std::string ControlColumn::Values() const {
  if (!words.empty()) return fmt::format("{}", fmt::join(words, ", "));
  if (whole) return "0 or 1";
  std::string range = fmt::format("{:g} to {:g}", lowest, highest);
  if (as_scene) range += fmt::format(", or {:g} for the scene's value", *as_scene);
  return range;
}

std::optional<double> ControlColumn::ValueOf(const std::string& word) const {
  const auto found = std::find(words.begin(), words.end(), word);
  if (found == words.end()) return std::nullopt;
  return static_cast<double>(found - words.begin());
}

bool ControlColumn::Allows(double value) const {
  if (as_scene && value == *as_scene) return true;
  return value >= lowest && value <= highest && (!whole || value == 0 || value == 1);
}

std::span<const ControlColumn> ControlColumns() {
  using Row = Command&;
  using ImagingLimits = effects::Imaging;
  using InjectorLimits = effects::Injector;
  using WedgeLimits = effects::Wedge;
  using TableLimits = effects::Table;
  constexpr double kShutter = ImagingLimits::kMostShutter;
  constexpr double kShare = WedgeLimits::kMostShare;
  constexpr double kTurn = WedgeLimits::kMostRotationDeg;
  constexpr double kScene = InjectorLimits::kAsScene;
  static const std::vector<ControlColumn> all = {
      {"lao_deg", -180, 180, {}, false, {}, [](double v, Row row) { row.lao_deg = v; }},
      {"cra_deg", -180, 180, {}, false, {}, [](double v, Row row) { row.cra_deg = v; }},
      {"xray", 0, 1, {}, true, {}, [](double v, Row row) { row.xray = v == 1; }},
      {"contrast", 0, 1, {}, true, {}, [](double v, Row row) { row.contrast = v == 1; }},
      {"table_left_mm",
       -TableLimits::kMostLeftMm,
       TableLimits::kMostLeftMm,
       {},
       false,
       {},
       [](double v, Row row) { row.table.left_mm = v; }},
      {"table_head_mm",
       -TableLimits::kMostHeadMm,
       TableLimits::kMostHeadMm,
       {},
       false,
       {},
       [](double v, Row row) { row.table.head_mm = v; }},
      {"table_height_mm",
       -TableLimits::kMostHeightMm,
       TableLimits::kMostHeightMm,
       {},
       false,
       {},
       [](double v, Row row) { row.table.height_mm = v; }},
      {"imaging_mode",
       0,
       4,
       {},
       false,
       {"as_scene", "plain", "subtraction", "roadmap", "cine"},
       [](double v, Row row) { row.imaging.mode = static_cast<Imaging::Mode>(v); }},
      {"pulses_per_s",
       ImagingLimits::kLeastPulses,
       ImagingLimits::kMostPulses,
       0,
       false,
       {},
       [](double v, Row row) { row.imaging.pulses_per_s = v; }},
      {"magnification",
       1,
       ImagingLimits::kMostMagnification,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.magnification = v; }},
      {"shutter_left", 0, kShutter, {}, false, {}, [](double v, Row row) { row.imaging.left = v; }},
      {"shutter_right",
       0,
       kShutter,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.right = v; }},
      {"shutter_top", 0, kShutter, {}, false, {}, [](double v, Row row) { row.imaging.top = v; }},
      {"shutter_bottom",
       0,
       kShutter,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.bottom = v; }},
      {"wedge_left",
       0,
       kShare,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.wedge_left.share = v; }},
      {"wedge_left_deg",
       -kTurn,
       kTurn,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.wedge_left.rotation_deg = v; }},
      {"wedge_right",
       0,
       kShare,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.wedge_right.share = v; }},
      {"wedge_right_deg",
       -kTurn,
       kTurn,
       {},
       false,
       {},
       [](double v, Row row) { row.imaging.wedge_right.rotation_deg = v; }},
      {"injector",
       0,
       2,
       {},
       false,
       {"off", "arm", "inject"},
       [](double v, Row row) { row.injector.order = static_cast<Injector::Order>(v); }},
      {"injector_volume_mL",
       InjectorLimits::kLeastVolumeML,
       InjectorLimits::kMostVolumeML,
       kScene,
       false,
       {},
       [](double v, Row row) { row.injector.volume_mL = v; }},
      {"injector_rate_mL_s",
       InjectorLimits::kLeastRateMLS,
       InjectorLimits::kMostRateMLS,
       kScene,
       false,
       {},
       [](double v, Row row) { row.injector.rate_mL_s = v; }},
      {"injector_delay_s",
       0,
       InjectorLimits::kMostDelayS,
       kScene,
       false,
       {},
       [](double v, Row row) { row.injector.delay_s = v; }},
      {"injector_rise_s", 0, InjectorLimits::kMostRiseS, kScene, false, {}, [](double v, Row row) {
         row.injector.rise_s = v;
       }}};
  return all;
}

}  // namespace torquer
