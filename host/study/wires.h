// Study wires: the paper's wire, and two wires of commercial types.
#pragma once

#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/core/wire_model.h"

namespace torquer::study {

/// Direction of an angled tip against the shaft.
inline constexpr double kAngledTip = std::numbers::pi / 4;

/// Wire and a matching wall stiffness.
struct StudyWire {
  std::string name;
  std::vector<WireSection> sections;
  double tip_mm = 10;  ///< length of the tip, which is curved
  double wall_stiffness_N_mm2 = 0;
};

/// The paper's wire: EI 6.35e-9 N m^2 throughout, 0.178 mm radius; wall 0.01 N/mm^2.
StudyWire PaperWire(double tip_angle_rad);
/// A 0.014-inch wire: steel core of 1.6e-4 N m^2, tapering over 120 mm to 1e-8 N m^2. The tip is
/// angled by 45 degrees; wall 1 N/mm^2.
StudyWire Wire014();
/// A 0.035-inch wire: 1e-3 N m^2, tapering over 100 mm to 1e-6 N m^2. The tip is angled by 45
/// degrees; wall 10 N/mm^2.
StudyWire Wire035();

}  // namespace torquer::study
