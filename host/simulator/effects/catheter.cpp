#include "host/simulator/effects/catheter.h"

#include <numbers>

#include "host/simulator/effects/sections.h"

namespace torquer::effects {

namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;

constexpr Key kLength = {"max_length_mm", "mm", 1, 5000, std::nullopt, "that can be inserted"};
constexpr Key kStart = {"inserted_at_start_mm", "mm", 0, 5000, 0, "inside at the start"};
constexpr Key kLumen = {
    "inner_radius_mm", "mm", 0.01, 5, std::nullopt, "of its lumen, wider than the wire"};
constexpr Key kRadius = {"radius_mm", "mm",         0.02,
                         5,           std::nullopt, "outer, if it is not by sections"};
constexpr Key kRigidity = {
    "rigidity_N_mm2", "N mm^2", 1e-7, 1e6, std::nullopt, "EI, if it is not by sections"};
constexpr Key kTip = {"tip_mm", "mm", 0, 300, 0, "length of its bent end"};
constexpr Key kAngle = {"tip_angle_deg", "deg", 0, 330, 0, "by which that is bent in all"};

CatheterParts Read(StrictTable& keys, double segment_mm) {
  CatheterParts parts;
  parts.max_length_mm = kLength.Read(keys);
  parts.inserted_at_start_mm = kStart.Read(keys);
  if (parts.inserted_at_start_mm > parts.max_length_mm) {
    keys.Refuse("inserted_at_start_mm", "is more than max_length_mm");
  }
  parts.inner_radius_mm = kLumen.Read(keys);
  parts.tip_mm = kTip.Read(keys);
  if (keys.Has("from_tip_mm")) {
    parts.sections = ReadSections(keys);
  } else {
    const double angle_rad = kRadPerDeg * kAngle.Read(keys);
    if (angle_rad > 0 && !(parts.tip_mm >= segment_mm)) {
      keys.Refuse("tip_mm", "must be at least a segment for a tip with an angle");
    }
    const double curvature = angle_rad > 0 ? angle_rad / parts.tip_mm : 0;
    const WireSection shaft{.from_tip_mm = parts.tip_mm + 1e-6,
                            .rigidity_N_mm2 = kRigidity.Read(keys),
                            .radius_mm = kRadius.Read(keys)};
    WireSection end = shaft;
    end.curvature_1_per_mm = curvature;
    for (const double from_tip_mm : {0.0, parts.tip_mm}) {
      end.from_tip_mm = from_tip_mm;
      if (parts.sections.empty() || from_tip_mm > 0) parts.sections.push_back(end);
    }
    parts.sections.push_back(shaft);
  }
  for (const WireSection& section : parts.sections) {
    if (section.radius_mm <= parts.inner_radius_mm) {
      keys.Refuse("inner_radius_mm", "is not less than the outer radius");
    }
  }
  return parts;
}

}  // namespace

EffectKind CatheterKind() {
  return {.name = "catheter",
          .summary = "a catheter around the wire, pushed and turned by a device of its own",
          .roles = "instrument",
          .keys = {kLength, kStart, kLumen, kRadius, kRigidity, kTip, kAngle},
          .other_keys = {{"from_tip_mm", "as in [effects.sections], with its other keys",
                          "instead of radius_mm, rigidity_N_mm2 and tip_angle_deg: a table"}},
          .needs = "",
          .excludes = "torsion",
          .make = nullptr,
          .catheter = Read};
}

}  // namespace torquer::effects
