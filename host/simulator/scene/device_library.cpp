#include "host/simulator/scene/device_library.h"

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "host/support/installed.h"

namespace torquer::scene {

namespace {

constexpr char kEnding[] = ".toml";

void CheckSource(const DeviceSource& source, StrictTable& table) {
  const bool modulus = source.flexural_modulus_GPa && source.outer_diameter_mm;
  const bool bending = source.span_mm && source.force_N && source.deflection_mm;
  const bool buckling = source.tip_load_gf && source.free_length_mm;
  if (modulus + bending + buckling + source.measured_N_mm2.has_value() == 1) return;
  table.Refuse("citation",
               "a source has figures of one kind: flexural_modulus_GPa and outer_diameter_mm; "
               "span_mm, force_N and deflection_mm; tip_load_gf and free_length_mm; or "
               "measured_N_mm2");
}

const Keys<DeviceSource>& SourceKeys() {
  using Spec = DeviceSource;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Required()
          .Text("citation", &Spec::citation, "citation of the source: author, journal, year")
          .Required()
          .Text("figure", &Spec::figure, "figure as published, with its range")
          .Required()
          .Number("from_tip_mm", &Spec::from_tip_mm, 0, 5000, "mm",
                  "distance from the tip to the place that the figure describes")
          .Number("flexural_modulus_GPa", &Spec::flexural_modulus_GPa, 1e-4, 1e3, "GPa",
                  "flexural modulus of the round section")
          .Number("outer_diameter_mm", &Spec::outer_diameter_mm, 0.01, 10, "mm",
                  "outer diameter of the round section")
          .Number("inner_diameter_mm", &Spec::inner_diameter_mm, 0, 10, "mm",
                  "inner diameter of the round section")
          .Number("span_mm", &Spec::span_mm, 1, 1000, "mm", "span of a three-point bending test")
          .Number("force_N", &Spec::force_N, 1e-6, 1000, "N", "force at the middle of the span")
          .Number("deflection_mm", &Spec::deflection_mm, 1e-4, 100, "mm",
                  "deflection at the middle of the span under force_N")
          .Number("tip_load_gf", &Spec::tip_load_gf, 1e-3, 1000, "gf",
                  "load at which the free end buckles")
          .Number("free_length_mm", &Spec::free_length_mm, 0.1, 100, "mm",
                  "length of the free end that buckles")
          .Number("measured_N_mm2", &Spec::measured_N_mm2, 1e-7, 1e6, "N mm^2",
                  "measured flexural rigidity EI")
          .Checked(CheckSource);
  return keys;
}

const Keys<DeviceSpec>& DeviceKeys() {
  using Spec = DeviceSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Required()
          .Choice("kind", &Spec::kind, {"guidewire", "catheter"}, "kind of device")
          .Required()
          .Text("product", &Spec::product, "name and size of the product")
          .Required()
          .Text("assumed", &Spec::assumed, "assumed values, which no source states")
          .Tables("source", &Spec::sources, SourceKeys(), 1,
                  "published figures, each with its source");
  return keys;
}

}  // namespace

std::string DeviceFolder() { return FindInstalled("share/torquer/devices"); }

std::vector<std::string> DeviceNames() {
  std::vector<std::string> names;
  std::error_code none;
  for (const auto& entry : std::filesystem::directory_iterator(DeviceFolder(), none)) {
    if (entry.path().extension() == kEnding) names.push_back(entry.path().stem());
  }
  std::sort(names.begin(), names.end());
  return names;
}

DeviceSpec ReadDevice(const std::string& name) {
  StrictTable file = StrictTable::Read(DeviceFolder() + "/" + name + kEnding);
  DeviceSpec device = DeviceKeys().Read(file);
  BuildKeys().ReadInto(file.Table("instrument"), device.instrument);
  file.RefuseUnread();
  return device;
}

}  // namespace torquer::scene
