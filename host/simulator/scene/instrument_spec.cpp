#include "host/simulator/scene/instrument_spec.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "host/simulator/effects/values_along.h"
#include "host/simulator/scene/device_library.h"
#include "host/support/angles.h"
#include "host/support/nearest_name.h"

namespace torquer::scene {

namespace {

// Two equal distances make a step: the second one is moved this much away from the tip.
constexpr double kStepMm = 1e-6;
// Limit on the sections, so that a mistaken list does not become a long search.
constexpr std::size_t kMostSections = 1000;
constexpr double kSolid_1_mm = 0.8;
constexpr double kHollow_1_mm = 0.4;

void CheckAlong(const InstrumentSpec& spec, StrictTable& table, const char* key,
                const std::vector<double>& values) {
  if (values.size() == 1 || values.size() == spec.from_tip_mm.size()) return;
  table.Refuse(key, fmt::format("has {} values; give one, or one for each of the {} of from_tip_mm",
                                values.size(), spec.from_tip_mm.size()));
}

void Check(const InstrumentSpec& spec, StrictTable& table) {
  for (const char c : spec.name) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-') continue;
    table.Refuse("name", "may have letters, digits, '_' and '-' only");
  }
  for (const auto& [key, given] : {std::pair("rigidity_N_mm2", !spec.rigidity_N_mm2.empty()),
                                   std::pair("radius_mm", !spec.radius_mm.empty())}) {
    if (!given) table.Refuse(key, "is missing; give it, or a device that has it");
  }
  const std::vector<double>& at = spec.from_tip_mm;
  if (at.size() > kMostSections) {
    table.Refuse("from_tip_mm",
                 fmt::format("has {} values; give at most {}", at.size(), kMostSections));
  }
  for (std::size_t k = 1; k < at.size(); ++k) {
    const bool step = at[k] == at[k - 1] && (k < 2 || at[k] > at[k - 2]);
    if (at[k] > at[k - 1] || step) continue;
    table.Refuse("from_tip_mm", "must increase; a repeated distance makes a step");
  }
  CheckAlong(spec, table, "rigidity_N_mm2", spec.rigidity_N_mm2);
  CheckAlong(spec, table, "radius_mm", spec.radius_mm);
  CheckAlong(spec, table, "curvature_1_per_mm", spec.curvature_1_per_mm);
  CheckAlong(spec, table, "curvature_2_per_mm", spec.curvature_2_per_mm);
  if (!spec.friction_coefficient.empty()) {
    CheckAlong(spec, table, "friction_coefficient", spec.friction_coefficient);
  }
  if (spec.inserted_at_start_mm > spec.max_length_mm) {
    table.Refuse("inserted_at_start_mm", "is more than max_length_mm; give at most that");
  }
  if (spec.tip_angle_deg > 0 && spec.tip_mm == 0) {
    table.Refuse("tip_angle_deg", "needs tip_mm, the length of the bent tip");
  }
  const std::vector<double>& bends = spec.curvature_1_per_mm;
  const bool bent = std::any_of(bends.begin(), bends.end(), [](double one) { return one != 0; });
  if (spec.tip_angle_deg > 0 && bent) {
    table.Refuse("tip_angle_deg",
                 table.Has("curvature_1_per_mm")
                     ? "cannot be given together with curvature_1_per_mm, which also bends the "
                       "tip; keep one"
                     : fmt::format("bends the tip, which the device {} bends too; remove it, or "
                                   "give curvature_1_per_mm = 0",
                                   spec.device));
  }
  const double thinnest = *std::min_element(spec.radius_mm.begin(), spec.radius_mm.end());
  if (spec.inner_radius_mm >= thinnest) {
    table.Refuse("inner_radius_mm",
                 fmt::format("must be less than the outer radius, {:g} mm", thinnest));
  }
  if (spec.coating_coefficient.has_value() != (spec.coating_mm > 0)) {
    table.Refuse("coating_mm", "must be given together with coating_coefficient; give both");
  }
  if (spec.coating_mm > 0 && spec.friction_coefficient.size() > 1) {
    table.Refuse(
        "coating_mm",
        "cannot be given together with a list of friction_coefficient, which describes the "
        "coated part too; keep one");
  }
}

// The distances of the lists. The second one of a step is moved away from the tip.
std::vector<double> Distances(const InstrumentSpec& spec) {
  std::vector<double> at = spec.from_tip_mm;
  for (std::size_t k = 1; k < at.size(); ++k) {
    if (at[k] == at[k - 1]) at[k] += kStepMm;
  }
  return at;
}

}  // namespace

const Keys<InstrumentSpec>& BuildKeys() {
  using Spec = InstrumentSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Numbers("from_tip_mm", &Spec::from_tip_mm, 0, 5000, "mm",
                   "distances from the tip for the lists below, which are interpolated linearly; a "
                   "repeated distance makes a step")
          .Otherwise("required without a device")
          .Numbers("rigidity_N_mm2", &Spec::rigidity_N_mm2, 1e-7, 1e6, "N mm^2",
                   "flexural rigidity EI: one value, or one per distance in from_tip_mm")
          .Otherwise("required without a device")
          .Numbers("radius_mm", &Spec::radius_mm, 0.01, 5, "mm",
                   "outer radius: one value, or one per distance in from_tip_mm")
          .Numbers("curvature_1_per_mm", &Spec::curvature_1_per_mm, -2, 2, "1/mm",
                   "rest curvature towards the first normal: one value, or one per distance in "
                   "from_tip_mm")
          .Numbers("curvature_2_per_mm", &Spec::curvature_2_per_mm, -2, 2, "1/mm",
                   "rest curvature towards the second normal: one value, or one per distance in "
                   "from_tip_mm")
          .Number("tip_mm", &Spec::tip_mm, 0, 300, "mm", "length of the shaped tip")
          .Number("tip_angle_deg", &Spec::tip_angle_deg, 0, 330, "deg",
                  "total bend angle of the tip, distributed evenly along tip_mm")
          .Number("torsional_rigidity_ratio", &Spec::torsional_rigidity_ratio, 0.01, 10, "",
                  "ratio GJ / EI, used by [effects.torsion]; 1 / (1 + Poisson's ratio) for a round "
                  "wire: 0.77 for steel, 0.75 for nitinol")
          .Number("inner_radius_mm", &Spec::inner_radius_mm, 0, 5, "mm",
                  "inner radius of the lumen, which must exceed the outer radius of the instrument "
                  "inside; 0: solid")
          .Otherwise("coefficient of [effects.friction]")
          .Numbers("friction_coefficient", &Spec::friction_coefficient, 0, 2, "",
                   "coefficient of Coulomb friction, mu, between the instrument's surface and the "
                   "wall: one value, or one per distance in from_tip_mm")
          .Number("coating_mm", &Spec::coating_mm, 0, 5000, "mm",
                  "length of the coated distal part")
          .Otherwise("none: no coating")
          .Number("coating_coefficient", &Spec::coating_coefficient, 0, 2, "",
                  "coefficient of Coulomb friction, mu, between the coated part and the wall")
          .Number("linear_density_g_m", &Spec::linear_density_g_m, 0, 1000, "g/m",
                  "effective mass per length: mass minus that of the displaced blood")
          .Otherwise("0.8 for a solid, 0.4 for a hollow instrument")
          .Number("attenuation_1_mm", &Spec::attenuation_1_mm, 0, 20, "1/mm",
                  "X-ray attenuation coefficient of the instrument's material")
          .Number("marker_mm", &Spec::marker_mm, 0, 1000, "mm",
                  "length of the radiopaque distal marker")
          .Number("marker_1_mm", &Spec::marker_1_mm, 0, 20, "1/mm",
                  "X-ray attenuation coefficient of the marker");
  return keys;
}

const Keys<InstrumentSpec>& InstrumentKeys() {
  using Spec = InstrumentSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Text("name", &Spec::name, "name of the instrument in commands, scripts and states")
          .Otherwise("none")
          .Text(
              "device", &Spec::device,
              "name of a device in host/devices; it supplies the keys below, from from_tip_mm on, "
              "that the scene does not give")
          .Required()
          .Number("max_length_mm", &Spec::max_length_mm, 1, 5000, "mm",
                  "largest insertion of the instrument; a larger command is clamped to it")
          .Number("inserted_at_start_mm", &Spec::inserted_at_start_mm, 0, 5000, "mm",
                  "insertion at the start of the scene, along the centerline")
          .Otherwise("none: it enters at [entry] and lies around the earlier instruments")
          .Table(
              "entry", &Spec::entry, EntryKeys(),
              "entry of an instrument that lies beside the earlier ones; one instrument may have "
              "it")
          .Include(BuildKeys())
          .Checked(Check)
          .Example(
              "name = \"guidewire\"\n"
              "max_length_mm = 700\n"
              "inserted_at_start_mm = 380\n"
              "radius_mm = 0.4445\n"
              "from_tip_mm = [0, 15, 80, 150]\n"
              "rigidity_N_mm2 = [1, 1, 100, 300]\n"
              "tip_mm = 15\n"
              "tip_angle_deg = 45\n");
  return keys;
}

InstrumentSpec ReadInstrument(StrictTable& table) {
  InstrumentSpec spec;
  if (table.Has("device")) {
    const std::string device = table.Text("device");
    const std::vector<std::string> known = DeviceNames();
    if (std::find(known.begin(), known.end(), device) == known.end()) {
      const std::string near = NearestName(device, known);
      table.Refuse("device", fmt::format("there is no such device; {}known in {}: {}",
                                         near.empty() ? "" : "did you mean \"" + near + "\"? ",
                                         DeviceFolder(), fmt::join(known, ", ")));
    }
    spec = ReadDevice(device).instrument;
  }
  spec.origin = table.Origin();
  InstrumentKeys().ReadInto(table, spec);
  return spec;
}

void WriteInstrument(const InstrumentSpec& spec, TomlWriter& out) {
  InstrumentSpec base;
  if (!spec.device.empty()) base = ReadDevice(spec.device).instrument;
  InstrumentKeys().Write(spec, base, out);
}

std::vector<WireSection> MakeSections(const InstrumentSpec& spec) {
  const std::vector<double> at = Distances(spec);
  const effects::ValuesAlong rigidity_N_mm2(at, spec.rigidity_N_mm2);
  const effects::ValuesAlong radius_mm(at, spec.radius_mm);
  const effects::ValuesAlong curvature_1_per_mm(at, spec.curvature_1_per_mm);
  const effects::ValuesAlong curvature_2_per_mm(at, spec.curvature_2_per_mm);
  const double angle_rad = spec.tip_angle_deg * kRadPerDeg;
  std::vector<double> stations = at;
  if (angle_rad > 0) {
    stations.insert(stations.end(), {0, spec.tip_mm, spec.tip_mm + kStepMm});
    std::sort(stations.begin(), stations.end());
    stations.erase(std::unique(stations.begin(), stations.end()), stations.end());
  }
  std::vector<WireSection> sections;
  for (const double s : stations) {
    const bool bent = angle_rad > 0 && s <= spec.tip_mm;
    sections.push_back(
        {.from_tip_mm = s,
         .rigidity_N_mm2 = rigidity_N_mm2.At(s),
         .radius_mm = radius_mm.At(s),
         .curvature_1_per_mm = bent ? angle_rad / spec.tip_mm : curvature_1_per_mm.At(s),
         .curvature_2_per_mm = curvature_2_per_mm.At(s)});
  }
  return sections;
}

effects::Instrument Describe(const InstrumentSpec& spec, const WireModel& model) {
  const double attenuation = spec.inner_radius_mm > 0 ? kHollow_1_mm : kSolid_1_mm;
  std::optional<effects::ValuesAlong> friction_coefficient;
  if (!spec.friction_coefficient.empty()) {
    friction_coefficient = {Distances(spec), spec.friction_coefficient};
  }
  return {.name = spec.name,
          .model = &model,
          .inner_radius_mm = spec.inner_radius_mm,
          .friction_coefficient = std::move(friction_coefficient),
          .coating_mm = spec.coating_mm,
          .coating_coefficient = spec.coating_coefficient.value_or(0),
          .linear_density_g_m = spec.linear_density_g_m,
          .attenuation_1_mm = spec.attenuation_1_mm.value_or(attenuation),
          .marker_mm = spec.marker_mm,
          .marker_1_mm = spec.marker_1_mm};
}

double OuterRadius(const InstrumentSpec& spec) {
  return *std::max_element(spec.radius_mm.begin(), spec.radius_mm.end());
}

}  // namespace torquer::scene
