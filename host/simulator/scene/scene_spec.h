// Contents of a scene file as plain data, read and checked without opening a mesh.
//
//   file --ReadScene--> SceneSpec --Scene (scene.h)--> Scene
//    ^                      |
//    +------ WriteScene ----+
#pragma once

#include <any>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/core/bending.h"
#include "host/simulator/core/paper/physical_relaxation.h"
#include "host/simulator/scene/entry_spec.h"
#include "host/simulator/scene/instrument_spec.h"
#include "host/support/key_table.h"

namespace torquer::scene {

/// [case]: texts for a trainee who chooses a case. They do not affect the simulation.
struct CaseSpec : TableSpec {
  std::string title;
  std::string task;
  int difficulty = 1;  ///< 1, for beginners, to 5
};

/// [vessel]: the keys that all vessels have, and those of one kind.
struct VesselSpec : TableSpec {
  std::string kind;  ///< one of vessel::AllVesselKinds()
  double wall_stiffness_N_mm2 = 0;
  std::any keys;  ///< spec of that kind
};

/// [patient_axes]: directions in the file's frame, such as "+x".
struct PatientAxesSpec : TableSpec {
  enum class Direction { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };
  Direction left = Direction::kPlusX;
  Direction posterior = Direction::kPlusY;
  Direction superior = Direction::kPlusZ;
};

enum class Method { kNewton, kPaper };

/// [relaxation.paper]: settings of the paper's method only.
struct PaperSpec : TableSpec {
  double max_update = 0.1;
  int margin = 5;
  UpdateRule update_rule = UpdateRule::kAbsolute;
};

/// [relaxation]: segments of the instruments, and the method that relaxes them.
struct RelaxationSpec : TableSpec {
  double segment_mm = 1;
  BendingLaw bending_law = BendingLaw::kExact;
  Method method = Method::kNewton;
  int contact_points_per_segment = 2;
  std::optional<double> tolerance;
  double tolerance_mm = 0;
  double longest_feed_mm = 0.25;
  double longest_tick_ms = 5;
  double budget_us = 700;
  std::optional<int> budget_units;
  std::optional<PaperSpec> paper;
};

/// [effects.NAME]
struct EffectSpec {
  std::string name;    ///< one of effects::AllEffects()
  std::any keys;       ///< spec of that effect
  TableOrigin origin;  ///< origin of [effects]
};

struct SceneSpec : TableSpec {
  std::string name;
  std::string path;              ///< path of the file, for messages
  std::filesystem::path folder;  ///< base of relative paths
  std::optional<CaseSpec> training_case;
  VesselSpec vessel;
  PatientAxesSpec axes;
  EntrySpec entry;
  std::vector<InstrumentSpec> instruments;  ///< the innermost first
  RelaxationSpec relaxation;
  std::vector<EffectSpec> effects;  ///< in the order of construction
  std::string text;                 ///< contents of the file
  TomlValues values;                ///< set in place of those in the text

  bool Has(const std::string& effect) const;
};

/// Path of a scene file. `given` is a path, or the name (letters, digits, _) of a scene in
/// share/torquer/scenes. A file that is called so has priority. Throws UserError naming the scenes
/// there.
std::string ScenePath(const std::string& given);

/// Reads a scene by ScenePath(given). Throws UserError naming file, line, key, value and remedy.
SceneSpec ReadScene(const std::string& given);
/// Reads a scene from text. `path` is for messages; `folder` is the base of relative paths.
SceneSpec ParseScene(const std::string& text, const std::string& path,
                     const std::filesystem::path& folder);
/// The scene of `spec` with other values of some keys; see TomlValues. Throws UserError. Messages
/// about the other keys have the lines of the file.
SceneSpec With(const SceneSpec& spec, const TomlValues& values);
/// The scene of `spec` with a device of the library as an instrument. Of the keys of the instrument
/// it keeps those that no device has: name, length, start and entry. Throws UserError.
SceneSpec WithDevice(const SceneSpec& spec, std::size_t instrument, const std::string& device);
/// Text of a scene file: the required keys, and the keys that differ from their defaults.
std::string WriteScene(const SceneSpec& spec);

/// One section of a scene file, for documentation.
struct Section {
  std::string heading;  ///< "[vessel]", "[[instrument]]"
  std::string name;     ///< "vessel.surface", "effects.friction"
  std::string summary;
  const KeyTable* keys;
};
/// All sections of a scene file.
std::vector<Section> AllSections();

}  // namespace torquer::scene
