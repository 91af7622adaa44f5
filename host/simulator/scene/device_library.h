// The devices of host/devices: guidewires and catheters, each value with its source.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/scene/instrument_spec.h"

namespace torquer::scene {

/// A published figure from which the rigidity at one place of a device follows. Of the figures
/// below it has those of one kind.
struct DeviceSource : TableSpec {
  std::string citation;
  std::string figure;      ///< as published, with its range
  double from_tip_mm = 0;  ///< the place
  // The flexural modulus of a round section.
  std::optional<double> flexural_modulus_GPa;
  std::optional<double> outer_diameter_mm;
  double inner_diameter_mm = 0;
  // Bending at three points.
  std::optional<double> span_mm;
  std::optional<double> force_N;
  std::optional<double> deflection_mm;
  // The load, in grams of weight, under which a free end that is pushed onto a plate buckles.
  std::optional<double> tip_load_gf;
  std::optional<double> free_length_mm;
  // The rigidity itself.
  std::optional<double> measured_N_mm2;
};

/// A device as its file has it.
struct DeviceSpec : TableSpec {
  enum class Kind { kWire, kCatheter };
  Kind kind = Kind::kWire;
  std::string product;
  std::string assumed;  ///< what no source says
  InstrumentSpec instrument;
  std::vector<DeviceSource> sources;
};

/// The folder of the devices, of the installation or of the sources (host/support/installed.h).
std::string DeviceFolder();
/// All devices of that folder by name, in order of the alphabet.
std::vector<std::string> DeviceNames();
/// Reads the device of a name of DeviceNames(). Throws UserError naming file, line, key, value and
/// remedy.
DeviceSpec ReadDevice(const std::string& name);

}  // namespace torquer::scene
