// An instrument as a scene writes it: [[instrument]].
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/effects/effect.h"
#include "host/support/key_table.h"

namespace torquer::scene {

/// The name of an instrument that has none.
inline constexpr char kGuidewire[] = "guidewire";

struct InstrumentSpec : TableSpec {
  std::string name = kGuidewire;
  std::string device;  ///< of the library, whose values hold where the scene gives none; "": none
  double max_length_mm = 0;
  double inserted_at_start_mm = 0;

  // Along the instrument, from its tip: one value, or one for each of from_tip_mm.
  std::vector<double> from_tip_mm = {0};
  std::vector<double> rigidity_N_mm2;
  std::vector<double> radius_mm;
  std::vector<double> curvature_1_per_mm = {0};
  std::vector<double> curvature_2_per_mm = {0};

  double tip_mm = 0;
  double tip_angle_deg = 0;
  double torsional_rigidity_ratio = 0.77;
  double inner_radius_mm = 0;
  std::optional<double> friction_coefficient;
  double coating_mm = 0;
  std::optional<double> coating_coefficient;
  double linear_density_g_m = 0;
  std::optional<double> attenuation_1_mm;
  double marker_mm = 0;
  double marker_1_mm = 4;
};

const Keys<InstrumentSpec>& InstrumentKeys();
/// Those of them that say how it is built, which a device of the library has.
const Keys<InstrumentSpec>& BuildKeys();
/// Reads an [[instrument]]: what its device has, and over it what the table gives. Throws
/// UserError.
InstrumentSpec ReadInstrument(StrictTable& table);
/// Writes what differs from its device, or without one from the defaults.
void WriteInstrument(const InstrumentSpec& spec, TomlWriter& out);

/// Its sections, cut so that the bent tip ends between two joints of segments of this length.
std::vector<WireSection> MakeSections(const InstrumentSpec& spec, double segment_mm);

/// What effects may know of it.
effects::Instrument Describe(const InstrumentSpec& spec, const WireModel& model);

/// The largest radius, mm.
double OuterRadius(const InstrumentSpec& spec);

}  // namespace torquer::scene
