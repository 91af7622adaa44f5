#include "host/simulator/command_limits.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

namespace torquer::simulator {

// Each comparison is false for NaN.
bool IsValid(const InstrumentPose& pose) {
  return std::abs(pose.insertion_mm) <= kPoseLimit && std::abs(pose.rotation_rad) <= kPoseLimit;
}

bool IsValid(const effects::Imaging& imaging) {
  using effects::Imaging;
  // NaN fails each of these.
  const auto shutter = [](double share) { return share >= 0 && share <= Imaging::kMostShutter; };
  const auto wedge = [](const effects::Wedge& one) {
    return one.share >= 0 && one.share <= effects::Wedge::kMostShare &&
           std::abs(one.rotation_deg) <= effects::Wedge::kMostRotationDeg;
  };
  return imaging.mode <= Imaging::Mode::kCine &&
         (imaging.pulses_per_s == 0 || (imaging.pulses_per_s >= Imaging::kLeastPulses &&
                                        imaging.pulses_per_s <= Imaging::kMostPulses)) &&
         imaging.magnification >= 1 && imaging.magnification <= Imaging::kMostMagnification &&
         shutter(imaging.left) && shutter(imaging.right) && shutter(imaging.top) &&
         shutter(imaging.bottom) && wedge(imaging.wedges[0]) && wedge(imaging.wedges[1]);
}

std::string InvalidValue(const effects::Injector& injector) {
  using effects::Injector;
  if (injector.order > Injector::Order::kInject) {
    return fmt::format("order {}; give off, arm or inject", static_cast<int>(injector.order));
  }
  const struct {
    const char* name;
    double value, least, most;
  } all[] = {{"volume_mL", injector.volume_mL, Injector::kLeastVolumeML, Injector::kMostVolumeML},
             {"rate_mL_s", injector.rate_mL_s, Injector::kLeastRateMLS, Injector::kMostRateMLS},
             {"delay_s", injector.delay_s, 0, Injector::kMostDelayS},
             {"rise_s", injector.rise_s, 0, Injector::kMostRiseS}};
  for (const auto& one : all) {
    // NaN fails each comparison.
    if (one.value == Injector::kAsScene || (one.value >= one.least && one.value <= one.most)) {
      continue;
    }
    return fmt::format("{} {:g}; give {:g} to {:g}, or {:g} for the scene's value", one.name,
                       one.value, one.least, one.most, Injector::kAsScene);
  }
  return "";
}

bool IsValid(const effects::Table& table) {
  using effects::Table;
  return std::abs(table.left_mm) <= Table::kMostLeftMm &&
         std::abs(table.head_mm) <= Table::kMostHeadMm &&
         std::abs(table.height_mm) <= Table::kMostHeightMm;
}

bool IsValid(const effects::Controls& controls) {
  return std::abs(controls.lao_rad) <= std::numbers::pi &&
         std::abs(controls.cra_rad) <= std::numbers::pi;
}

}  // namespace torquer::simulator
