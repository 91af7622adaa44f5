#include "host/simulator/effects/sections.h"

namespace torquer::effects {

namespace {

// Two distances that are the same are a step: the second stands this much farther.
constexpr double kStepMm = 1e-6;

// One value for each of `count` places, or one for all.
std::vector<double> Along(StrictTable& keys, const char* key, std::size_t count, double lowest,
                          double highest) {
  std::vector<double> values = keys.Numbers(key, lowest, highest);
  if (values.size() == 1) values.assign(count, values.front());
  if (values.size() != count) {
    keys.Refuse(key, "needs one value, or one for each of from_tip_mm");
  }
  return values;
}

}  // namespace

std::vector<WireSection> ReadSections(StrictTable& keys) {
  std::vector<double> from_tip = keys.Numbers("from_tip_mm", 0, 5000);
  for (std::size_t k = 1; k < from_tip.size(); ++k) {
    if (from_tip[k] == from_tip[k - 1] && (k < 2 || from_tip[k] > from_tip[k - 2] + kStepMm)) {
      from_tip[k] += kStepMm;
    }
    if (!(from_tip[k] > from_tip[k - 1])) {
      keys.Refuse("from_tip_mm", "must ascend; the same distance twice makes a step");
    }
  }
  const std::size_t count = from_tip.size();
  const std::vector<double> rigidity = Along(keys, "rigidities_N_mm2", count, 1e-7, 1e6);
  const std::vector<double> radius = Along(keys, "radii_mm", count, 0.01, 5);
  std::vector<double> bends[2];
  const char* const names[] = {"curvatures_1_per_mm", "curvatures_2_per_mm"};
  for (int k = 0; k < 2; ++k) {
    bends[k].assign(count, 0);
    if (keys.Has(names[k])) bends[k] = Along(keys, names[k], count, -2, 2);
  }
  std::vector<WireSection> sections;
  for (std::size_t k = 0; k < count; ++k) {
    sections.push_back({from_tip[k], rigidity[k], radius[k], bends[0][k], bends[1][k]});
  }
  return sections;
}

EffectKind SectionsKind() {
  return {.name = "sections",
          .summary = "the wire from a table: rigidity, radius and rest shape along it",
          .roles = "shape",
          .keys = {},
          .other_keys = {{"from_tip_mm",
                          "list of 0 to 5000 mm, ascending; the same twice makes a step, which "
                          "falls between two joints",
                          "distances from the distal end; linear in between"},
                         {"rigidities_N_mm2", "one, or one for each distance; 1e-7 to 1e6 N mm^2",
                          "flexural rigidity EI"},
                         {"radii_mm", "one, or one for each distance; 0.01 to 5 mm",
                          "radius of the wire"},
                         {"curvatures_1_per_mm",
                          "one, or one for each distance; -2 to 2 / mm, if not given 0",
                          "rest curvature towards the wire's first normal"},
                         {"curvatures_2_per_mm",
                          "one, or one for each distance; -2 to 2 / mm, if not given 0",
                          "the same towards its second normal"}},
          .needs = "",
          .make = nullptr,
          .sections = ReadSections};
}

}  // namespace torquer::effects
