#include "host/simulator/scene/scene_spec.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <system_error>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/effects/effect.h"
#include "host/simulator/vessel/vessel.h"
#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/installed.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"

namespace torquer::scene {

namespace {

struct NameSpec : TableSpec {
  std::string name;
};

const Keys<NameSpec>& NameKeys() {
  static const Keys<NameSpec> keys = Keys<NameSpec>()
                                         .Required()
                                         .Text("name", &NameSpec::name, "name of the scene")
                                         .Example("name = \"my_scene\"\n");
  return keys;
}

const Keys<CaseSpec>& CaseKeys() {
  using Spec = CaseSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Required()
          .Text("title", &Spec::title, "title of the case in the list of cases")
          .Required()
          .Text("task", &Spec::task, "task that the trainee has to perform")
          .Required()
          .Integer("difficulty", &Spec::difficulty, 1, 5, "difficulty from 1 (for beginners) to 5")
          .Example(
              "title = \"Cerebral angiogram\"\n"
              "task = \"Bring the tip into the left common carotid artery.\"\n"
              "difficulty = 3\n");
  return keys;
}

struct WallSpec : TableSpec {
  double wall_stiffness_N_mm2 = 0;
};

// Keys that every kind of vessel has besides its own.
const Keys<WallSpec>& WallKeys() {
  static const Keys<WallSpec> keys = Keys<WallSpec>().Required().Number(
      "wall_stiffness_N_mm2", &WallSpec::wall_stiffness_N_mm2, 1e-6, 1e3, "N/mm^2",
      "stiffness of the vessel's wall, per length of wire in contact");
  return keys;
}

const Keys<PatientAxesSpec>& AxesKeys() {
  using Spec = PatientAxesSpec;
  static const std::vector<std::string> names = {"+x", "-x", "+y", "-y", "+z", "-z"};
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Required()
          .Choice("left", &Spec::left, names,
                  "direction in the file's frame that points to the patient's left")
          .Required()
          .Choice("posterior", &Spec::posterior, names,
                  "direction in the file's frame that points to the patient's back")
          .Required()
          .Choice("superior", &Spec::superior, names,
                  "direction in the file's frame that points to the patient's head")
          .Example(
              "left = \"+y\"\n"
              "posterior = \"-z\"\n"
              "superior = \"-x\"\n");
  return keys;
}

const Keys<PaperSpec>& PaperKeys() {
  using Spec = PaperSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Number("max_update", &Spec::max_update, 1e-4, 2, "rad",
                  "largest rotation of a segment in one update, du_max in equation (18)")
          .Integer("margin", &Spec::margin, 1, 1000,
                   "number of segments proximal to the tip that a Tip Relaxation updates fully")
          .Choice("update_rule", &Spec::update_rule,
                  {"signed", "rho_only", "absolute", "exact_root"},
                  "update rule of a segment: equation (16), (17) or (19), or the exact root of the "
                  "equation before (19)")
          .Example("update_rule = \"exact_root\"\n");
  return keys;
}

const Keys<RelaxationSpec>& RelaxationKeys() {
  using Spec = RelaxationSpec;
  static const Keys<Spec> keys =
      Keys<Spec>()
          .Number("segment_mm", &Spec::segment_mm, 0.05, 10, "mm",
                  "length of a segment, into which the instruments are divided")
          .Choice("bending_law", &Spec::bending_law, {"exact", "g1", "g2"},
                  "bending energy law: exact, or one of its approximations g1 and g2")
          .Choice("method", &Spec::method, {"newton", "paper"},
                  "relaxation method: Newton's method, or that of Baier et al. (2016)")
          .Integer("contact_points_per_segment", &Spec::contact_points_per_segment, 1, 8,
                   "number of points per segment at which contact with the wall is computed")
          .Otherwise("1e-6; 1e-3 with method = \"paper\"")
          .Number("tolerance", &Spec::tolerance, 1e-10, 1, "1/mm",
                  "residual at which a tick ends, as the out-of-balance moment over the local EI")
          .Number("tolerance_mm", &Spec::tolerance_mm, 0, 10, "mm",
                  "estimated solver error (solver_error_mm) below which a tick may end, in "
                  "addition to tolerance; 0: not used")
          .Number(
              "longest_feed_mm", &Spec::longest_feed_mm, 0.01, 5, "mm",
              "longest feed before the instruments are relaxed again; at most half a segment, or "
              "0.25 mm if that is more")
          .Number("longest_tick_ms", &Spec::longest_tick_ms, 0.1, 100, "ms",
                  "longest tick of a script while the vessel moves or an effect evolves; with "
                  "inertia at most 1")
          .Number("budget_us", &Spec::budget_us, 20, 1e6, "us",
                  "time budget of a tick in a live session")
          .Otherwise("1000; 100 with method = \"paper\"")
          .Integer("budget_units", &Spec::budget_units, 1, 1000000,
                   "work budget of a tick in a script, in units of actions and attempted steps")
          .Table("paper", &Spec::paper, PaperKeys(), "settings of method = \"paper\"")
          .Checked([](const Spec& spec, StrictTable& table) {
            if (spec.method == Method::kPaper) {
              if (table.Has("contact_points_per_segment")) {
                table.Refuse("contact_points_per_segment",
                             "is not supported by the paper's method, which has one contact point; "
                             "remove it");
              }
              if (table.Has("tolerance_mm")) {
                table.Refuse(
                    "tolerance_mm",
                    "is not supported by the paper's method, which estimates no error; remove it");
              }
              if (table.Has("longest_feed_mm")) {
                table.Refuse("longest_feed_mm",
                             "is not supported by the paper's method, which feeds one segment at a "
                             "time; remove it");
              }
            } else if (spec.paper) {
              table.Refuse("paper",
                           "needs method = \"paper\"; give that method or remove this table");
            }
          })
          .Example(
              "segment_mm = 0.5\n"
              "tolerance = 1e-5\n");
  return keys;
}

VesselSpec ReadVessel(StrictTable& table) {
  const std::vector<vessel::VesselKind>& kinds = vessel::AllVesselKinds();
  std::vector<std::string> names;
  for (const vessel::VesselKind& kind : kinds) names.push_back(kind.name);
  VesselSpec spec;
  spec.origin = table.Origin();
  const auto& kind = kinds[static_cast<std::size_t>(table.Choice("kind", names))];
  spec.kind = kind.name;
  spec.wall_stiffness_N_mm2 = WallKeys().Read(table).wall_stiffness_N_mm2;
  spec.keys = kind.keys.read(table);
  return spec;
}

const effects::EffectKind& FindEffect(const StrictTable& table, const std::string& name) {
  std::vector<std::string> known;
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.name == name) return kind;
    known.push_back(kind.name);
  }
  const std::string near = NearestName(name, known);
  table.Refuse(
      name, fmt::format("there is no such effect; {}known: {}",
                        near.empty() ? "" : "did you mean " + near + "? ", fmt::join(known, ", ")));
}

std::vector<EffectSpec> ReadEffects(StrictTable& table, const RelaxationSpec& relaxation) {
  for (const std::string& name : table.Keys()) FindEffect(table, name);
  std::vector<EffectSpec> specs;
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    StrictTable* const keys = table.OptionalTable(kind.name);
    if (keys == nullptr) continue;
    if (!kind.needs.empty() && !table.Has(kind.needs)) {
      table.Refuse(kind.name, "needs [effects." + kind.needs +
                                  "], which this scene does not have; add it or remove this table");
    }
    const bool is_stage = kind.shape != nullptr || kind.room != nullptr;
    if (is_stage && relaxation.method == Method::kPaper) {
      table.Refuse(kind.name,
                   "changes the unknowns of the wire, which the paper's method does not support; "
                   "remove it or choose relaxation.method = \"newton\"");
    }
    specs.push_back({kind.name, kind.keys.read(*keys), table.Origin()});
  }
  return specs;
}

// Checks that at most one instrument has an entry, and that it is not the first.
void CheckOwnEntry(const std::vector<InstrumentSpec>& all, std::size_t k) {
  if (!all[k].entry) return;
  if (k == 0) {
    all[k].origin.Refuse("entry",
                         "the first instrument enters at [entry]; remove [instrument.entry], or "
                         "list the instrument later");
  }
  for (std::size_t j = 0; j < k; ++j) {
    if (!all[j].entry) continue;
    all[k].origin.Refuse("entry",
                         fmt::format("{} has an entry too, and at most one instrument may lie "
                                     "beside others; remove one of both [instrument.entry]",
                                     all[j].name));
  }
}

// Checks that an instrument has a lumen for the instrument inside it, or for two beside each other.
void CheckLumen(const std::vector<InstrumentSpec>& all, std::size_t k) {
  if (k == 0 || all[k].entry) return;
  const InstrumentSpec& inner = all[k - 1];
  if (!inner.entry) {
    if (all[k].inner_radius_mm > OuterRadius(inner)) return;
    all[k].origin.Refuse("inner_radius_mm",
                         fmt::format("must be more than the radius of {}, {:g} mm, which lies in "
                                     "it; list the innermost instrument first",
                                     inner.name, OuterRadius(inner)));
  }
  const InstrumentSpec& other = all[k - 2];
  const double both_mm = OuterRadius(inner) + OuterRadius(other);
  if (all[k].inner_radius_mm > both_mm) return;
  all[k].origin.Refuse("inner_radius_mm",
                       fmt::format("must be more than {:g} mm, the sum of the radii of {} and {}, "
                                   "which lie beside each other in it; give a wider lumen, or list "
                                   "{} last",
                                   both_mm, other.name, inner.name, inner.name));
}

// Checks the instruments against each other and against the rest of the scene.
void CheckInstruments(const SceneSpec& spec) {
  const std::vector<InstrumentSpec>& all = spec.instruments;
  if (all.size() > static_cast<std::size_t>(kMostInstruments)) {
    all.back().origin.Refuse("name", fmt::format("is instrument number {}; a scene has at most {}",
                                                 all.size(), kMostInstruments));
  }
  if (spec.relaxation.method == Method::kPaper && all.size() > 1) {
    all[1].origin.Refuse("name",
                         "the paper's method supports a single instrument; remove this instrument "
                         "or choose relaxation.method = \"newton\"");
  }
  for (std::size_t k = 0; k < all.size(); ++k) {
    const InstrumentSpec& instrument = all[k];
    for (std::size_t j = 0; j < k; ++j) {
      if (all[j].name != instrument.name) continue;
      instrument.origin.Refuse("name",
                               "another instrument of this scene has this name; choose another");
    }
    if (instrument.tip_angle_deg > 0 && !(instrument.tip_mm >= spec.relaxation.segment_mm)) {
      instrument.origin.Refuse("tip_mm",
                               "must be at least one segment long for a tip with tip_angle_deg");
    }
    const EntrySpec& entry = instrument.entry ? *instrument.entry : spec.entry;
    if (instrument.inserted_at_start_mm > 0 && !entry.centerline && entry.path_mm.empty()) {
      instrument.origin.Refuse("inserted_at_start_mm",
                               "needs a path along which the instrument lies; give entry.path_mm, "
                               "or entry.centerline instead of entry.point_mm");
    }
    CheckOwnEntry(all, k);
    CheckLumen(all, k);
  }
}

SceneSpec Read(const std::string& text, const TomlValues& values, const std::string& path,
               std::filesystem::path folder) {
  StrictTable file = StrictTable::Parse(text, path, values);
  SceneSpec spec;
  spec.origin = file.Origin();
  spec.path = path;
  spec.folder = std::move(folder);
  spec.text = text;
  spec.values = values;
  spec.name = NameKeys().Read(file).name;
  if (StrictTable* table = file.OptionalTable("case")) spec.training_case = CaseKeys().Read(*table);
  spec.vessel = ReadVessel(file.Table("vessel"));
  if (StrictTable* axes = file.OptionalTable("patient_axes")) spec.axes = AxesKeys().Read(*axes);
  spec.entry = EntryKeys().Read(file.Table("entry"));
  for (StrictTable* table : file.Tables("instrument")) {
    spec.instruments.push_back(ReadInstrument(*table));
  }
  if (spec.instruments.empty()) {
    file.Refuse("instrument",
                "is missing; add a table [[instrument]] for each, the innermost first");
  }
  if (StrictTable* table = file.OptionalTable("relaxation")) {
    spec.relaxation = RelaxationKeys().Read(*table);
  }
  if (StrictTable* table = file.OptionalTable("effects")) {
    spec.effects = ReadEffects(*table, spec.relaxation);
  }
  file.RefuseUnread();
  CheckInstruments(spec);
  return spec;
}

}  // namespace

bool SceneSpec::Has(const std::string& effect) const {
  return std::any_of(effects.begin(), effects.end(),
                     [&](const EffectSpec& spec) { return spec.name == effect; });
}

std::string ScenePath(const std::string& given) {
  namespace fs = std::filesystem;
  const bool is_name = !given.empty() && std::all_of(given.begin(), given.end(), [](char letter) {
    return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
  });
  std::error_code error;
  if (!is_name || fs::exists(given, error)) return given;
  const fs::path folder = FindInstalled("share/torquer/scenes");
  fs::path file = folder / (given + ".toml");
  if (fs::exists(file, error)) return file.string();
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".toml") names.push_back(entry.path().stem().string());
  }
  std::sort(names.begin(), names.end());
  const std::string near = NearestName(given, names);
  throw UserError(fmt::format(
      "{}: there is no such file, and no scene of that name; {}Torquer has: {}", Printable(given),
      near.empty() ? "" : "did you mean " + near + "? ", fmt::join(names, ", ")));
}

SceneSpec ReadScene(const std::string& given) {
  const std::string path = ScenePath(given);
  return Read(ReadInputFile(path, "check the path and its permissions"), {}, path,
              std::filesystem::path(path).parent_path());
}

SceneSpec ParseScene(const std::string& text, const std::string& path,
                     const std::filesystem::path& folder) {
  return Read(text, {}, path, folder);
}

SceneSpec With(const SceneSpec& spec, const TomlValues& values) {
  TomlValues all = spec.values;
  all.insert(all.end(), values.begin(), values.end());
  return Read(spec.text, all, spec.path, spec.folder);
}

SceneSpec WithDevice(const SceneSpec& spec, std::size_t instrument, const std::string& device) {
  const InstrumentSpec& before = spec.instruments[instrument];
  const std::string table =
      "instrument." + (before.origin.Has("name") ? before.name : std::to_string(instrument)) + '.';
  TomlValues values;
  for (const Key& key : BuildKeys().keys()) values.emplace_back(table + key.name, std::monostate());
  values.emplace_back(table + "device", device);
  SceneSpec base = spec;
  // They would add up if instruments are exchanged often.
  std::erase_if(base.values, [&values](const auto& set) {
    return std::any_of(values.begin(), values.end(),
                       [&set](const auto& value) { return value.first == set.first; });
  });
  return With(base, values);
}

std::string WriteScene(const SceneSpec& spec) {
  TomlWriter out;
  NameSpec name;
  name.name = spec.name;
  NameKeys().Write(name, out);
  if (spec.training_case) CaseKeys().Write(*spec.training_case, out.Table("case"));
  TomlWriter& vessel = out.Table("vessel");
  for (const vessel::VesselKind& kind : vessel::AllVesselKinds()) {
    if (kind.name != spec.vessel.kind) continue;
    vessel.Value("kind", '"' + kind.name + '"');
    WallSpec wall;
    wall.wall_stiffness_N_mm2 = spec.vessel.wall_stiffness_N_mm2;
    WallKeys().Write(wall, vessel);
    kind.keys.write(spec.vessel.keys, vessel);
  }
  const PatientAxesSpec axes;
  if (spec.axes.left != axes.left || spec.axes.posterior != axes.posterior ||
      spec.axes.superior != axes.superior) {
    AxesKeys().Write(spec.axes, out.Table("patient_axes"));
  }
  EntryKeys().Write(spec.entry, out.Table("entry"));
  for (const InstrumentSpec& instrument : spec.instruments) {
    WriteInstrument(instrument, out.Table("instrument", true));
  }
  RelaxationKeys().Write(spec.relaxation, out.Table("relaxation"));
  TomlWriter& effects = out.Table("effects");
  for (const EffectSpec& effect : spec.effects) {
    for (const effects::EffectKind& kind : effects::AllEffects()) {
      if (kind.name == effect.name) kind.keys.write(effect.keys, effects.Table(kind.name));
    }
  }
  return out.Text();
}

std::vector<Section> AllSections() {
  std::vector<Section> all = {
      {"", "", "keys at the top of the scene file", &NameKeys()},
      {"[case]", "case", "entry of the scene in the list of cases", &CaseKeys()},
      {"[vessel]", "vessel", "keys of every kind of vessel", &WallKeys()}};
  for (const vessel::VesselKind& kind : vessel::AllVesselKinds()) {
    all.push_back({"[vessel]", "vessel." + kind.name,
                   "kind = \"" + kind.name + "\": " + kind.summary, kind.keys.table});
  }
  all.push_back({"[patient_axes]", "patient_axes",
                 "orientation of the patient in the file's frame; default: left +x, posterior +y, "
                 "superior +z",
                 &AxesKeys()});
  all.push_back({"[entry]", "entry", "entry of the instruments into the vessel", &EntryKeys()});
  all.push_back({"[[instrument]]", "instrument",
                 "one table for each instrument of the coaxial stack, the innermost first",
                 &InstrumentKeys()});
  all.push_back({"[relaxation]", "relaxation", "segments, method and budget of the relaxation",
                 &RelaxationKeys()});
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    std::string summary = kind.summary;
    if (!kind.needs.empty()) summary += "; needs [effects." + kind.needs + "]";
    all.push_back({"[effects." + kind.name + "]", "effects." + kind.name, std::move(summary),
                   kind.keys.table});
  }
  return all;
}

}  // namespace torquer::scene
