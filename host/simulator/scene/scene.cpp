#include "host/simulator/scene/scene.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "host/simulator/vessel/lumen_check.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::scene {

using Eigen::Vector3d;

namespace {

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

Vector3d UnitVector(PatientAxesSpec::Direction direction) {
  const int k = static_cast<int>(direction);
  return (k % 2 == 0 ? 1 : -1) * Vector3d::Unit(k / 2);
}

}  // namespace

Scene::Scene(SceneSpec spec) : spec_(std::move(spec)) {
  vessel_ = KindOf(spec_.vessel).build(spec_.vessel.keys, spec_.folder);
  Build();
  HashContent();
}

Scene::Scene(Twin twin)
    : spec_(twin.of.spec_), vessel_(twin.of.vessel_), content_hash_(twin.of.content_hash_) {
  Build();
}

std::unique_ptr<Scene> Scene::MakeTwin() const {
  return std::unique_ptr<Scene>(new Scene(Twin{*this}));
}

void Scene::Build() {
  wall_.stiffness_N_mm2 = spec_.vessel.wall_stiffness_N_mm2;
  MakeAxes();
  MakeEntry();
  MakeStack();
  CheckFit();
  SetRelaxation();
  for (const EffectSpec& effect : spec_.effects) MakeEffect(effect);
}

void Scene::MakeAxes() {
  axes_.left = UnitVector(spec_.axes.left);
  axes_.posterior = UnitVector(spec_.axes.posterior);
  axes_.superior = UnitVector(spec_.axes.superior);
  if (axes_.left.cross(axes_.posterior).dot(axes_.superior) < 0.5) {
    spec_.axes.origin.Refuse(
        "superior",
        "left, posterior and superior do not form a right-handed frame; a patient's do (left x "
        "posterior = superior)");
  }
}

void Scene::MakeEntry() {
  const EntrySpec& entry = spec_.entry;
  if (entry.point_mm) {
    sheath_.point_mm = *entry.point_mm;
    sheath_.direction = entry.direction->normalized();
    return;
  }
  const vessel::CenterlineNetwork& network = vessel_.centerlines;
  if (network.empty()) {
    entry.origin.Refuse("centerline",
                        "this vessel has no centerlines; give point_mm and direction");
  }
  const auto place = [&](const char* key, const std::string& curve, double at_mm) {
    try {
      return network.Place(curve, at_mm);
    } catch (const UserError& error) {
      entry.origin.Refuse(key, error.what());
    }
  };
  const vessel::CenterlinePlace from = place("centerline", *entry.centerline, entry.at_mm);
  vessel::CenterlineSample start = network.At(from);
  const auto follow = [this](const vessel::Centerline& way, double from_mm) {
    for (double s = from_mm; s < way.length_mm(); s += 0.5) {
      start_path_mm_.push_back(way.At(s).position_mm);
    }
  };
  // With `towards` the start path follows the way to that place, otherwise the curve.
  if (entry.towards) {
    const vessel::CenterlinePlace to = place("towards", *entry.towards, entry.towards_at_mm);
    try {
      const vessel::Centerline way = network.Path(from, to);
      start = way.At(0);
      follow(way, 0);
    } catch (const UserError& error) {
      entry.origin.Refuse("towards", error.what());
    }
  } else {
    follow(network.curves()[from.curve], from.s_mm);
  }
  sheath_.point_mm = start.position_mm;
  sheath_.direction = start.tangent.normalized();
}

WireModel Scene::MakeInstrument(const InstrumentSpec& spec, double segment_mm,
                                BendingLaw law) const {
  std::vector<WireSection> sections = MakeSections(spec);
  for (const EffectSpec& effect : spec_.effects) {
    if (const effects::ShapeChange shape = KindOf(effect).shape) {
      shape(sections, spec.torsional_rigidity_ratio);
    }
  }
  return WireModel(segment_mm, std::move(sections), spec.tip_mm, spec.max_length_mm, law, sheath_);
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
      clearance = room(effect.keys, bare, wall_);
    }
  }
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

// The thickest instrument must fit into the lumen at the entry.
void Scene::CheckFit() const {
  double radius_mm = 0;
  for (const InstrumentSpec& spec : spec_.instruments) {
    radius_mm = std::max(radius_mm, OuterRadius(spec));
  }
  const vessel::LumenReport report = vessel::CheckPlace(
      *vessel_.field, vessel_.centerlines, sheath_.point_mm, sheath_.direction, radius_mm);
  if (!report.problem.empty()) {
    spec_.entry.origin.Refuse(spec_.entry.point_mm ? "point_mm" : "centerline", report.problem);
  }
}

void Scene::SetRelaxation() {
  const RelaxationSpec& spec = spec_.relaxation;
  if (spec.method == Method::kNewton) {
    newton_.tolerance = spec.tolerance.value_or(newton_.tolerance);
    newton_.tolerance_mm = spec.tolerance_mm;
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

void Scene::MakeEffect(const EffectSpec& spec) {
  const effects::EffectKind& kind = KindOf(spec);
  if (kind.make == nullptr) return;  // this kind only shapes the instruments
  effects_.push_back(kind.make(spec.keys, {.wire = rod(),
                                           .wall = wall_,
                                           .field = vessel_.field.get(),
                                           .centerlines = &vessel_.centerlines,
                                           .bounds_mm = vessel_.bounds_mm,
                                           .axes = axes_,
                                           .earlier = &effects_,
                                           .moving = moving_.get(),
                                           .instruments = instruments_,
                                           .stack = stack_.get()}));
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
  if (stiffness != nullptr) wall_.by_place = stiffness;
  if (motion != nullptr) {
    if (moving_ == nullptr) moving_ = std::make_unique<vessel::MovingField>(*vessel_.field);
    moving_->Add(*motion);
  }
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
  for (const std::string& contents : vessel_.contents) {
    content_hash_ = Fnv1a(contents, content_hash_);
  }
  vessel_.contents = {};
}

std::vector<std::string> Scene::effect_names() const {
  std::vector<std::string> names;
  for (const EffectSpec& effect : spec_.effects) names.push_back(effect.name);
  return names;
}

InstrumentPlaces Scene::start() const {
  InstrumentPlaces places(stack_->size());
  for (int k = 0; k < places.size(); ++k) {
    places[k].insertion_mm = spec_.instruments[static_cast<std::size_t>(k)].inserted_at_start_mm;
  }
  return places;
}

std::unique_ptr<Relaxation> Scene::MakeRelaxation() {
  return MakeRelaxation([](std::size_t, EnergyTerm* term) { return term; });
}

std::unique_ptr<Relaxation> Scene::MakeRelaxation(const StandIn& stand_in) {
  if (method() == Method::kPaper) {
    return std::make_unique<PaperRelaxation>(rod(), *vessel_.field, wall_, paper_);
  }
  terms_.clear();
  for (std::size_t k = 0; k < effects_.size(); ++k) {
    if (EnergyTerm* term = effects_[k]->energy_term()) terms_.push_back(stand_in(k, term));
  }
  const ClearanceField& field = moving_ != nullptr ? *moving_ : *vessel_.field;
  return MakeNewtonRelaxation(*stack_, field, wall_, newton_, terms_);
}

WireState Scene::MakeStart(Relaxation& relaxation) const {
  const InstrumentPlaces here = start();
  WireState state = WireState::Along(rod(), start_path_mm_, here);
  relaxation.Restart(state);
  for (int tick = 0; tick < 20; ++tick) {
    CountedBudget budget(budget_units_);
    if (relaxation.Tick(here, budget, state).converged) break;
  }
  return state;
}

}  // namespace torquer::scene
