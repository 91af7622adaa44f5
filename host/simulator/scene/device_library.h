// The devices of host/devices: guidewires and catheters, each value with its source.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host/simulator/scene/instrument_spec.h"

namespace torquer::scene {

/// Published figure that gives the bending rigidity at one place of a device. It has values of
/// exactly one of the kinds below.
struct DeviceSource : TableSpec {
  std::string citation;
  std::string figure;      ///< as published, with its range
  double from_tip_mm = 0;  ///< arc length from the tip to that place
  // Flexural modulus of a round section.
  std::optional<double> flexural_modulus_GPa;
  std::optional<double> outer_diameter_mm;
  double inner_diameter_mm = 0;
  // Three-point bending.
  std::optional<double> span_mm;
  std::optional<double> force_N;
  std::optional<double> deflection_mm;
  // Load, in grams-force, under which a free end that is pushed onto a plate buckles.
  std::optional<double> tip_load_gf;
  std::optional<double> free_length_mm;
  // Measured rigidity.
  std::optional<double> measured_N_mm2;
};

/// Contents of a device's file.
struct DeviceSpec : TableSpec {
  enum class Kind { kWire, kCatheter };
  Kind kind = Kind::kWire;
  std::string product;
  std::string assumed;  ///< text: values without a source, and their basis
  InstrumentSpec instrument;
  std::vector<DeviceSource> sources;
};

/// Path of the device folder, in the installation or in the source tree (host/support/installed.h).
std::string DeviceFolder();
/// Names of all devices in that folder, in alphabetical order.
std::vector<std::string> DeviceNames();
/// Reads the device `name`, one of DeviceNames(). Throws UserError naming file, line, key, value
/// and remedy.
DeviceSpec ReadDevice(const std::string& name);

}  // namespace torquer::scene
