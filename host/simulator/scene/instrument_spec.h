// Keys of an instrument in a scene file: [[instrument]].
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/entry_spec.h"
#include "host/support/key_table.h"

namespace torquer::scene {

/// Default name of an instrument.
inline constexpr char kGuidewire[] = "guidewire";

struct InstrumentSpec : TableSpec {
  std::string name = kGuidewire;
  std::string device;  ///< library device for the values that the scene omits; "": none
  double max_length_mm = 0;
  double inserted_at_start_mm = 0;
  std::optional<EntrySpec> entry;  ///< of an instrument beside the earlier ones

  // Values along the instrument from its tip: one for all, or one for each of from_tip_mm.
  std::vector<double> from_tip_mm = {0};
  std::vector<double> rigidity_N_mm2;
  std::vector<double> radius_mm;
  std::vector<double> curvature_1_per_mm = {0};
  std::vector<double> curvature_2_per_mm = {0};
  std::vector<double> friction_coefficient;  ///< empty: that of [effects.friction]

  double tip_mm = 0;
  double tip_angle_deg = 0;
  double torsional_rigidity_ratio = 0.77;
  double inner_radius_mm = 0;
  double coating_mm = 0;
  std::optional<double> coating_coefficient;
  double linear_density_g_m = 0;
  std::optional<double> attenuation_1_mm;
  double marker_mm = 0;
  double marker_1_mm = 4;
};

const Keys<InstrumentSpec>& InstrumentKeys();
/// Subset of InstrumentKeys() that describes the build; a device of the library has these keys.
const Keys<InstrumentSpec>& BuildKeys();
/// Reads an [[instrument]]: the device's values, replaced by the values of the table. Throws
/// UserError.
InstrumentSpec ReadInstrument(StrictTable& table);
/// Writes the values that differ from the device, or from the defaults if there is no device.
void WriteInstrument(const InstrumentSpec& spec, TomlWriter& out);

/// Sections of the instrument.
std::vector<WireSection> MakeSections(const InstrumentSpec& spec);

/// Description for effects. `model` must outlive it.
effects::Instrument Describe(const InstrumentSpec& spec, const WireModel& model);

/// Largest outer radius along the instrument, mm.
double OuterRadius(const InstrumentSpec& spec);

}  // namespace torquer::scene
