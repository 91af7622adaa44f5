#include "host/simulator/scene/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "host/simulator/vessel/lumen_check.h"
#include "host/simulator/vessel/mesh_vessel.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/printable_text.h"

namespace torquer::scene {

using Eigen::Vector3d;

namespace {

constexpr double kRounding_mm = 1e-9;

const vessel::VesselKind& KindOf(const VesselSpec& spec) {
  for (const vessel::VesselKind& kind : vessel::AllVesselKinds()) {
    if (kind.name == spec.kind) return kind;
  }
  spec.origin.Refuse("kind", "there is no kind of vessel named '" + spec.kind + "'");
}

const effects::EffectKind& KindOf(const EffectSpec& spec) {
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.name == spec.name) return kind;
  }
  throw UserError("effects." + spec.name + ": there is no such effect");
}

// Keys of a vessel that decide its field, and the base of their paths.
std::string SourceOf(const SceneSpec& spec) {
  TomlWriter out;
  KindOf(spec.vessel).keys.write(spec.vessel.keys, out);
  return spec.vessel.kind + '\n' + spec.folder.string() + '\n' + out.Text();
}

Vector3d UnitVector(PatientAxesSpec::Direction direction) {
  const int k = static_cast<int>(direction);
  return (k % 2 == 0 ? 1 : -1) * Vector3d::Unit(k / 2);
}

}  // namespace

Scene::Scene(SceneSpec spec) : spec_(std::move(spec)) {
  vessel_ = KindOf(spec_.vessel).build(spec_.vessel.keys, spec_.folder);
  HashFiles();
  Build(nullptr);
  HashContent();
}

Scene::Scene(SceneSpec spec, const Scene& other) : spec_(std::move(spec)) {
  if (SourceOf(spec_) == SourceOf(other.spec_)) {
    vessel_ = other.vessel_;
    files_hash_ = other.files_hash_;
    Build(&other);
  } else {
    vessel_ = KindOf(spec_.vessel).build(spec_.vessel.keys, spec_.folder);
    HashFiles();
    Build(nullptr);
  }
  HashContent();
}

Scene::Scene(Twin twin)
    : spec_(twin.of.spec_),
      vessel_(twin.of.vessel_),
      files_hash_(twin.of.files_hash_),
      content_hash_(twin.of.content_hash_) {
  Build(&twin.of);
}

std::unique_ptr<Scene> Scene::MakeTwin() const {
  return std::unique_ptr<Scene>(new Scene(Twin{*this}));
}

std::unique_ptr<Scene> Scene::WithDevice(int instrument, const std::string& device) const {
  const auto number = static_cast<std::size_t>(instrument);
  try {
    return std::make_unique<Scene>(scene::WithDevice(spec_, number, device), *this);
  } catch (const UserError& error) {
    throw UserError(
        fmt::format("{} cannot be exchanged for the device {}, so it stays; choose another device "
                    "({})",
                    instruments_[number].name, Printable(device), error.what()));
  }
}

void Scene::Build(const Scene* sharing) {
  wall_.stiffness_N_mm2 = spec_.vessel.wall_stiffness_N_mm2;
  MakeAxes();
  MakeEntries();
  MakeStack();
  SetRelaxation();
  for (const EffectSpec& effect : spec_.effects) MakeEffect(effect, sharing);
}

void Scene::MakeAxes() {
  axes_.left = UnitVector(spec_.axes.left);
  axes_.posterior = UnitVector(spec_.axes.posterior);
  axes_.superior = UnitVector(spec_.axes.superior);
  if (axes_.left.cross(axes_.posterior).dot(axes_.superior) < 0.5) {
    spec_.axes.origin.Refuse(
        "superior",
        "left, posterior and superior do not form a right-handed frame; give directions with left "
        "x posterior = superior");
  }
}

void Scene::MakeEntries() {
  entry_ = FindEntry(spec_.entry, vessel_.centerlines);
  double radius_mm = 0;
  for (const InstrumentSpec& spec : spec_.instruments) {
    if (!spec.entry) radius_mm = std::max(radius_mm, OuterRadius(spec));
  }
  CheckFit(spec_.entry, entry_, radius_mm);
  for (const InstrumentSpec& spec : spec_.instruments) {
    if (!spec.entry) continue;
    own_entry_ = FindEntry(*spec.entry, vessel_.centerlines);
    CheckFit(*spec.entry, own_entry_, OuterRadius(spec));
    CheckApart(spec);
  }
}

// The thickest instrument of an entry must fit into the lumen there, and its path lies inside.
void Scene::CheckFit(const EntrySpec& spec, const Entry& entry, double radius_mm) const {
  for (std::size_t k = 0; k < spec.path_mm.size(); ++k) {
    const Eigen::Vector3d& point = spec.path_mm[k];
    if (vessel_.field->Clearance(point) > 0) continue;
    spec.origin.Refuse(
        "path_mm", fmt::format("point {} of {}, ({:g}, {:g}, {:g}), lies outside the lumen; give "
                               "points in the lumen",
                               k + 1, spec.path_mm.size(), point[0], point[1], point[2]));
  }
  const vessel::LumenReport report =
      vessel::CheckPlace(*vessel_.field, vessel_.centerlines, entry.sheath.point_mm,
                         entry.sheath.direction, radius_mm);
  if (report.problem.empty()) return;
  const bool is_moved = !spec.offset_mm.isZero(0);
  spec.origin.Refuse(is_moved        ? "offset_mm"
                     : spec.point_mm ? "point_mm"
                                     : "centerline",
                     report.problem);
}

// An instrument beside others must not begin inside one of them.
void Scene::CheckApart(const InstrumentSpec& beside) const {
  const double distance_mm = (own_entry_.sheath.point_mm - entry_.sheath.point_mm).norm();
  for (const InstrumentSpec& spec : spec_.instruments) {
    if (&spec == &beside) return;
    const double least_mm = OuterRadius(spec) + OuterRadius(beside);
    if (distance_mm >= least_mm - kRounding_mm) continue;
    beside.entry->origin.Refuse(
        "offset_mm",
        fmt::format("the entry is {:g} mm from that of {}; it must be at least {:g} mm away, the "
                    "sum of both radii; move it with offset_mm",
                    distance_mm, spec.name, least_mm));
  }
}

WireModel Scene::MakeInstrument(const InstrumentSpec& spec, double segment_mm,
                                BendingLaw law) const {
  std::vector<WireSection> sections = MakeSections(spec);
  for (const EffectSpec& effect : spec_.effects) {
    if (const effects::ShapeChange shape = KindOf(effect).shape) {
      shape(sections, spec.torsional_rigidity_ratio);
    }
  }
  return WireModel(segment_mm, std::move(sections), spec.tip_mm, spec.max_length_mm, law,
                   spec.entry ? own_entry_.sheath : entry_.sheath);
}

std::string Scene::KeepField() const {
  return vessel_.surface == nullptr ? "" : vessel_.surface->SaveCache();
}

std::unique_ptr<WireModel> Scene::MakeWire(double segment_mm, BendingLaw law) const {
  return std::make_unique<WireModel>(MakeInstrument(spec_.instruments.front(), segment_mm, law));
}

void Scene::MakeStack() {
  std::vector<WireModel> models;
  for (const InstrumentSpec& spec : spec_.instruments) {
    try {
      models.push_back(
          MakeInstrument(spec, spec_.relaxation.segment_mm, spec_.relaxation.bending_law));
    } catch (const std::invalid_argument& error) {
      spec.origin.Refuse("name", error.what());
    }
  }
  Clearance clearance;
  std::vector<effects::Instrument> bare;
  for (std::size_t k = 0; k < models.size(); ++k) {
    bare.push_back(Describe(spec_.instruments[k], models[k]));
  }
  for (const EffectSpec& effect : spec_.effects) {
    if (const effects::MakeRoom& room = KindOf(effect).room) {
      room(effect.keys, bare, wall_, clearance);
    }
  }
  LayBeside(clearance);
  try {
    stack_ = std::make_unique<InstrumentStack>(std::move(models), clearance);
  } catch (const std::invalid_argument& error) {
    spec_.instruments.back().origin.Refuse("name", error.what());
  }
  for (int k = 0; k < stack_->size(); ++k) {
    instruments_.push_back(
        Describe(spec_.instruments[static_cast<std::size_t>(k)], stack_->instrument(k)));
  }
}

// Sets the contact of the instrument that lies beside the earlier ones.
void Scene::LayBeside(Clearance& clearance) const {
  const std::vector<InstrumentSpec>& all = spec_.instruments;
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (!all[k].entry) continue;
    if (clearance.has_room[k]) {
      all[k].origin.Refuse(
          "entry",
          fmt::format("no instrument lies in the lumen of {}, which lies beside the earlier ones; "
                      "name another one in effects.clearance.around, or remove [effects.clearance]",
                      all[k].name));
    }
    if (k + 1 < all.size() && !clearance.has_room[k + 1]) {
      all[k + 1].origin.Refuse("name",
                               "is around instruments that lie beside each other and needs room; "
                               "name it in effects.clearance.around");
    }
    clearance.is_beside[k] = true;
    clearance.start_path_mm[k] = own_entry_.start_path_mm;
    if (clearance.stiffness_N_mm2 == 0) clearance.stiffness_N_mm2 = wall_.stiffness_N_mm2;
  }
}

void Scene::SetRelaxation() {
  const RelaxationSpec& spec = spec_.relaxation;
  if (spec.method == Method::kNewton) {
    newton_.tolerance = spec.tolerance.value_or(newton_.tolerance);
    newton_.tolerance_mm = spec.tolerance_mm;
    newton_.max_feed_mm = spec.longest_feed_mm;
    wall_.points_per_segment = spec.contact_points_per_segment;
    budget_units_ = spec.budget_units.value_or(1000);
    return;
  }
  wall_.points_per_segment = 1;
  paper_.tolerance = spec.tolerance.value_or(paper_.tolerance);
  const PaperSpec paper = spec.paper.value_or(PaperSpec());
  paper_.physical.max_update = paper.max_update;
  paper_.physical.margin = paper.margin;
  paper_.physical.rule = paper.update_rule;
  budget_units_ = spec.budget_units.value_or(100);
}

const effects::Effect* Scene::FindEffect(const std::string& name) const {
  const auto found = std::find(names_of_effects_.begin(), names_of_effects_.end(), name);
  if (found == names_of_effects_.end()) return nullptr;
  return effects_[static_cast<std::size_t>(found - names_of_effects_.begin())].get();
}

void Scene::MakeEffect(const EffectSpec& spec, const Scene* sharing) {
  const effects::EffectKind& kind = KindOf(spec);
  if (kind.make == nullptr) return;  // this kind only shapes the instruments
  const bool has_same_axes = sharing != nullptr && sharing->axes_ == axes_;
  const effects::Effect* const other = has_same_axes ? sharing->FindEffect(kind.name) : nullptr;
  effects_.push_back(kind.make(spec.keys, {.wire = stack_->empty_rod(),
                                           .wall = wall_,
                                           .field = &vessel_.wire_field(),
                                           .centerlines = &vessel_.centerlines,
                                           .bounds_mm = vessel_.bounds_mm,
                                           .axes = axes_,
                                           .earlier = &effects_,
                                           .moving = moving_.get(),
                                           .instruments = instruments_,
                                           .stack = stack_.get(),
                                           .vessel = &vessel_,
                                           .folder = spec_.folder,
                                           .other = other}));
  names_of_effects_.push_back(kind.name);
  effects::Effect& effect = *effects_.back();
  EnergyTerm* const term = effect.energy_term();
  const WallStiffness* const stiffness = effect.wall_stiffness();
  vessel::FieldMotion* const motion = effect.motion();
  if (method() == Method::kPaper &&
      (term != nullptr || stiffness != nullptr || motion != nullptr)) {
    spec.origin.Refuse(spec.name,
                       "changes the energy of the wire, which the paper's method does not support; "
                       "remove it or choose relaxation.method = \"newton\"");
  }
  if (stiffness != nullptr) wall_.stiffness_field = stiffness;
  if (motion != nullptr) {
    if (moving_ == nullptr) moving_ = std::make_unique<vessel::MovingField>(vessel_.wire_field());
    moving_->Add(*motion);
  }
}

void Scene::HashFiles() {
  std::uint64_t hash = Fnv1a("");
  for (const std::string& contents : vessel_.contents) hash = Fnv1a(contents, hash);
  if (!vessel_.contents.empty()) files_hash_ = Hex(hash);
  vessel_.contents = {};
}

void Scene::HashContent() {
  SceneSpec simulated = spec_;
  simulated.training_case.reset();
  content_hash_ = Fnv1a(WriteScene(simulated));
  for (const InstrumentSpec& instrument : spec_.instruments) {
    if (instrument.device.empty()) continue;
    // The scene's text omits the values that come from the device.
    TomlWriter out;
    InstrumentKeys().Write(instrument, out);
    content_hash_ = Fnv1a(out.Text(), content_hash_);
  }
  content_hash_ = Fnv1a(files_hash_, content_hash_);
  for (const std::unique_ptr<effects::Effect>& effect : effects_) {
    const std::uint64_t hash = effect->FileHash();
    if (hash != 0) content_hash_ = Fnv1a(Hex(hash), content_hash_);
  }
}

std::vector<std::string> Scene::effect_names() const {
  std::vector<std::string> names;
  for (const EffectSpec& effect : spec_.effects) names.push_back(effect.name);
  return names;
}

InstrumentPoses Scene::start() const {
  InstrumentPoses poses(stack_->size());
  for (int k = 0; k < poses.size(); ++k) {
    poses[k].insertion_mm = spec_.instruments[static_cast<std::size_t>(k)].inserted_at_start_mm;
  }
  return poses;
}

std::unique_ptr<Relaxation> Scene::MakeRelaxation() {
  return MakeRelaxation([](std::size_t, EnergyTerm* term) { return term; });
}

std::unique_ptr<Relaxation> Scene::MakeRelaxation(const StandIn& stand_in) {
  if (method() == Method::kPaper) {
    return std::make_unique<PaperRelaxation>(stack_->empty_rod(), vessel_.wire_field(), wall_,
                                             paper_);
  }
  terms_.clear();
  for (std::size_t k = 0; k < effects_.size(); ++k) {
    if (EnergyTerm* term = effects_[k]->energy_term()) terms_.push_back(stand_in(k, term));
  }
  return MakeNewtonRelaxation(*stack_, WireField(), wall_, newton_, terms_);
}

const ClearanceField& Scene::WireField() const {
  if (moving_ != nullptr) return *moving_;
  return vessel_.wire_field();
}

std::unique_ptr<ShadowWire> Scene::MakeShadow() {
  std::vector<EnergyTerm*> terms;
  for (const std::unique_ptr<effects::Effect>& effect : effects_) {
    if (EnergyTerm* term = effect->energy_term()) terms.push_back(term);
  }
  return std::make_unique<ShadowWire>(*stack_, WireField(), wall_, std::move(terms));
}

WireState Scene::MakeStart(Relaxation& relaxation, bool* converged) const {
  const InstrumentPoses here = start();
  WireState state = WireState::Along(stack_->empty_rod(), entry_.start_path_mm, here);
  relaxation.Restart(state);
  bool is_relaxed = false;
  for (int tick = 0; tick < 20 && !is_relaxed; ++tick) {
    CountedBudget budget(budget_units_);
    is_relaxed = relaxation.Tick(here, budget, state).converged;
  }
  if (converged != nullptr) *converged = is_relaxed;
  return state;
}

}  // namespace torquer::scene
