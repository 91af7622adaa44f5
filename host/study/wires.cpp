#include "host/study/wires.h"

#include <algorithm>
#include <cmath>

namespace torquer::study {

namespace {

constexpr double kCurvedTipMm = 10;
constexpr double kStepMm = 1e-6;  // of the curvature, at the end of the tip

// EI grows from `tip` to `shaft` along `taper_mm`. It is the fourth power of a core whose diameter
// grows linearly. The tip is curved by `angle` over kCurvedTipMm.
StudyWire Tapered(const std::string& name, double tip_N_mm2, double shaft_N_mm2, double taper_mm,
                  double radius_mm, double angle_rad, double wall_N_mm2) {
  StudyWire wire{name, {}, kCurvedTipMm, wall_N_mm2};
  const double a = std::pow(tip_N_mm2, 0.25);
  const double b = std::pow(shaft_N_mm2, 0.25);
  std::vector<double> stations = {0, kCurvedTipMm, kCurvedTipMm + kStepMm};
  if (a != b) {
    for (int k = 1; k <= 24; ++k) stations.push_back(taper_mm * k / 24);
  }
  std::sort(stations.begin(), stations.end());
  stations.erase(std::unique(stations.begin(), stations.end()), stations.end());
  for (const double s : stations) {
    const double core = a + (b - a) * std::min(1.0, s / taper_mm);
    wire.sections.push_back(
        {s, std::pow(core, 4), radius_mm, s <= kCurvedTipMm ? angle_rad / kCurvedTipMm : 0, 0});
  }
  return wire;
}

}  // namespace

StudyWire PaperWire(double tip_angle_rad) {
  return Tapered("paper", 6.35e-3, 6.35e-3, 100, 0.178, tip_angle_rad, 0.01);
}

StudyWire Wire014() { return Tapered("wire014", 1e-2, 160, 120, 0.178, kAngledTip, 1); }

StudyWire Wire035() { return Tapered("wire035", 1, 1000, 100, 0.4445, kAngledTip, 10); }

}  // namespace torquer::study
