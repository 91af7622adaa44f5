// A scene as plain data: what a file says, read and checked, with no mesh opened.
//
//   file --ReadScene--> SceneSpec --BuildScene (scene.h)--> Scene
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
#include "host/simulator/scene/instrument_spec.h"
#include "host/support/key_table.h"

namespace torquer::scene {

/// [case]: what a trainee reads who chooses a case. Changes nothing that is simulated.
struct CaseSpec : TableSpec {
  std::string title;
  std::string task;
  int difficulty = 1;  ///< 1, for beginners, to 5
};

/// [vessel]: what every vessel has, and the keys of its kind.
struct VesselSpec : TableSpec {
  std::string kind;  ///< one of vessel::AllVesselKinds()
  double wall_stiffness_N_mm2 = 0;
  std::any keys;  ///< of the kind
};

/// [patient_axes]: directions of the file's frame, such as "+x".
struct PatientAxesSpec : TableSpec {
  enum class Direction { kPlusX, kMinusX, kPlusY, kMinusY, kPlusZ, kMinusZ };
  Direction left = Direction::kPlusX;
  Direction posterior = Direction::kPlusY;
  Direction superior = Direction::kPlusZ;
};

/// [entry]: where the instruments enter, at a point or at a place on a centerline.
struct EntrySpec : TableSpec {
  std::optional<Eigen::Vector3d> point_mm;
  std::optional<Eigen::Vector3d> direction;
  std::optional<std::string> centerline;
  double at_mm = 0;
  std::optional<std::string> towards;
  double towards_at_mm = 0;
};

enum class Method { kNewton, kPaper };

/// [relaxation.paper]: of the paper's method alone.
struct PaperSpec : TableSpec {
  double max_update = 0.1;
  int margin = 5;
  UpdateRule update_rule = UpdateRule::kAbsolute;
};

/// [relaxation]: how the instruments are cut into segments and relaxed.
struct RelaxationSpec : TableSpec {
  double segment_mm = 1;
  BendingLaw bending_law = BendingLaw::kExact;
  Method method = Method::kNewton;
  int contact_points_per_segment = 2;
  std::optional<double> tolerance;
  double tolerance_mm = 0;
  double budget_us = 700;
  std::optional<int> budget_units;
  std::optional<PaperSpec> paper;
};

/// [effects.NAME]
struct EffectSpec {
  std::string name;    ///< one of effects::AllEffects()
  std::any keys;       ///< of that effect
  TableOrigin origin;  ///< of [effects]
};

struct SceneSpec : TableSpec {
  std::string name;
  std::string path;              ///< of the file; for messages
  std::filesystem::path folder;  ///< that paths are relative to
  std::optional<CaseSpec> training_case;
  VesselSpec vessel;
  PatientAxesSpec axes;
  EntrySpec entry;
  std::vector<InstrumentSpec> instruments;  ///< the innermost first
  RelaxationSpec relaxation;
  std::vector<EffectSpec> effects;  ///< in the order in which they are made

  bool Has(const std::string& effect) const;
};

/// The file of a scene: `given`, or where that is a name (letters, digits, _) and no file is called
/// so, the scene of that name in share/torquer/scenes. Throws UserError naming the scenes there.
std::string ScenePath(const std::string& given);

/// Reads a scene by ScenePath(given). Throws UserError naming file, line, key, value and remedy.
SceneSpec ReadScene(const std::string& given);
/// The same from text: `path` for messages, paths relative to `folder`.
SceneSpec ParseScene(const std::string& text, const std::string& path,
                     const std::filesystem::path& folder);
/// As a file: what differs from the defaults, and what must be given.
std::string WriteScene(const SceneSpec& spec);

/// One section of a scene file, for documentation.
struct Section {
  std::string heading;  ///< "[vessel]", "[[instrument]]"
  std::string name;     ///< "vessel.surface", "effects.friction"
  std::string summary;
  const KeyTable* keys;
};
/// All sections that there are.
std::vector<Section> AllSections();

}  // namespace torquer::scene
