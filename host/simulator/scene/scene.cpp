#include "host/simulator/scene/scene.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

#include "host/simulator/scene/vessel_reader.h"
#include "host/simulator/vessel/lumen_check.h"
#include "host/support/error.h"
#include "host/support/fnv1a.h"

namespace torquer::scene {

using Eigen::Vector3d;

namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;

// "+x", "-y" ..: a direction of the vessel's frame.
Vector3d ReadDirection(StrictTable& table, const std::string& key) {
  static const std::vector<std::string> names = {"+x", "-x", "+y", "-y", "+z", "-z"};
  const int choice = table.Choice(key, names);
  return (choice % 2 == 0 ? 1.0 : -1.0) * Vector3d::Unit(choice / 2);
}

}  // namespace

Scene::Scene(const std::string& path) : path_(path) {
  StrictTable file = StrictTable::Read(path);
  name_ = file.Text("name");
  VesselReader reader(file, std::filesystem::path(path).parent_path());
  vessel_ = reader.Read();
  content_hash_ = HashFiles(path, reader.files());
  wall_.stiffness_N_mm2 = file.Table("vessel").Number("wall_stiffness_N_mm2", 1e-6, 1e3);
  ReadAxes(file);
  ReadWire(file);
  ReadRelaxation(file);
  ReadEffects(file);
  file.RefuseUnread();
}

void Scene::ReadAxes(StrictTable& file) {
  StrictTable* table = file.OptionalTable("patient_axes");
  if (table == nullptr) return;
  axes_.left = ReadDirection(*table, "left");
  axes_.posterior = ReadDirection(*table, "posterior");
  axes_.superior = ReadDirection(*table, "superior");
  if (axes_.left.cross(axes_.posterior).dot(axes_.superior) < 0.5) {
    table->Refuse("superior",
                  "left, posterior and superior do not form a right-handed frame; a patient's do "
                  "(left x posterior = superior)");
  }
}

Sheath Scene::ReadEntry(StrictTable& file) {
  StrictTable& entry = file.Table("entry");
  Sheath sheath;
  if (entry.Has("point_mm")) {
    sheath.point_mm = entry.Point("point_mm");
    const Vector3d direction = entry.Point("direction");
    if (!(direction.norm() > 1e-9)) entry.Refuse("direction", "has no length");
    sheath.direction = direction.normalized();
    return sheath;
  }
  if (vessel_.centerlines.empty()) {
    entry.Refuse("point_mm",
                 "is missing, and this vessel has no centerlines to enter by; give "
                 "point_mm and direction");
  }
  const vessel::CenterlineNetwork& network = vessel_.centerlines;
  const auto place = [&](const char* curve_key, const char* at_key) {
    const std::string curve = entry.Text(curve_key);
    try {
      return network.Place(curve, entry.Number(at_key, 0, 1e5, 0));
    } catch (const UserError& error) {
      entry.Refuse(curve_key, error.what());
    }
  };
  const vessel::CenterlinePlace from = place("centerline", "at_mm");
  const vessel::CenterlinePlace to =
      entry.Has("towards") ? place("towards", "towards_at_mm") : from;
  // Towards a place: along the way there. Else along the curve.
  vessel::CenterlineSample start = network.At(from);
  if (entry.Has("towards")) {
    const vessel::Centerline way = network.Path(from, to);
    start = way.At(0);
    for (double s = 0; s < way.length_mm(); s += 0.5) {
      start_path_mm_.push_back(way.At(s).position_mm);
    }
  } else {
    const vessel::Centerline& curve = network.curves()[from.curve];
    for (double s = from.s_mm; s < curve.length_mm(); s += 0.5) {
      start_path_mm_.push_back(curve.At(s).position_mm);
    }
  }
  sheath.point_mm = start.position_mm;
  sheath.direction = start.tangent.normalized();
  return sheath;
}

void Scene::CheckFit(double radius_mm, const Sheath& sheath, const StrictTable& entry) const {
  const vessel::LumenReport report = vessel::CheckPlace(
      *vessel_.field, vessel_.centerlines, sheath.point_mm, sheath.direction, radius_mm);
  if (!report.problem.empty()) throw UserError(entry.Where() + ": entry: " + report.problem);
}

void Scene::ReadWire(StrictTable& file) {
  parts_.sheath = ReadEntry(file);
  StrictTable& wire = file.Table("wire");
  const double segment_mm = wire.Number("segment_mm", 0.05, 10);
  parts_.max_length_mm = wire.Number("max_length_mm", segment_mm, 5000);
  parts_.tip_mm = wire.Number("tip_mm", 0, 300, 0);
  ReadShape(file, wire, segment_mm);

  const BendingLaw laws[] = {BendingLaw::kExact, BendingLaw::kG1, BendingLaw::kG2};
  const BendingLaw law = laws[wire.Choice("bending_law", {"exact", "g1", "g2"}, 0)];
  inserted_at_start_mm_ = wire.Number("inserted_at_start_mm", 0, parts_.max_length_mm, 0);
  if (inserted_at_start_mm_ > 0 && start_path_mm_.empty()) {
    wire.Refuse("inserted_at_start_mm",
                "needs centerlines to lie along; give the entry as a place on a centerline");
  }
  try {
    wire_ = MakeWire(segment_mm, law);
    ReadCatheter(file, segment_mm, law);
  } catch (const std::invalid_argument& error) {
    throw UserError(wire.Where() + ": wire: " + error.what());
  }
  CheckFit(parts_.radius_mm, parts_.sheath, file.Table("entry"));
}

void Scene::ReadShape(StrictTable& file, StrictTable& wire, double segment_mm) {
  StrictTable* effects = file.OptionalTable("effects");
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.sections == nullptr || effects == nullptr || !effects->Has(kind.name)) continue;
    for (const char* key : {"radius_mm", "tip_angle_deg", "rigidity_N_mm2", "rigidities_N_mm2",
                            "rigidities_from_tip_mm"}) {
      if (wire.Has(key)) {
        wire.Refuse(key, "stands beside [effects." + std::string(kind.name) +
                             "], which gives the same; keep one of the two");
      }
    }
    parts_.sections = kind.sections(effects->Table(kind.name));
  }
  if (parts_.sections.empty()) ReadPlainWire(wire, segment_mm);
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.shape == nullptr || effects == nullptr || !effects->Has(kind.name)) continue;
    parts_.shapes.push_back(kind.shape(effects->Table(kind.name)));
  }
  for (const WireSection& section : parts_.sections) {
    parts_.radius_mm = std::max(parts_.radius_mm, section.radius_mm);
  }
}

void Scene::ReadPlainWire(StrictTable& wire, double segment_mm) {
  parts_.tip_angle_rad = kRadPerDeg * wire.Number("tip_angle_deg", 0, 330, 0);
  parts_.radius_mm = wire.Number("radius_mm", 0.01, 5);
  if (parts_.tip_angle_rad > 0 && !(parts_.tip_mm >= segment_mm)) {
    wire.Refuse("tip_mm", "must be at least a segment for a tip with an angle");
  }

  // EI as a table of distances from the tip, or one number.
  std::vector<double>& from_tip = parts_.from_tip_mm;
  std::vector<double>& rigidity = parts_.rigidity_N_mm2;
  if (wire.Has("rigidity_N_mm2")) {
    rigidity = {wire.Number("rigidity_N_mm2", 1e-7, 1e6)};
  } else {
    rigidity = wire.Numbers("rigidities_N_mm2", 1e-7, 1e6);
    from_tip = wire.Numbers("rigidities_from_tip_mm", 0, 5000);
    if (from_tip.size() != rigidity.size()) {
      wire.Refuse("rigidities_from_tip_mm", "needs one distance for each of rigidities_N_mm2");
    }
  }
  for (std::size_t k = 1; k < from_tip.size(); ++k) {
    if (!(from_tip[k] > from_tip[k - 1])) {
      wire.Refuse("rigidities_from_tip_mm", "must ascend");
    }
  }
}

void Scene::ReadCatheter(StrictTable& file, double segment_mm, BendingLaw law) {
  StrictTable* effects = file.OptionalTable("effects");
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.catheter == nullptr || effects == nullptr || !effects->Has(kind.name)) continue;
    StrictTable& keys = effects->Table(kind.name);
    effects::CatheterParts parts = kind.catheter(keys, segment_mm);
    if (*kind.excludes != 0 && effects->Has(kind.excludes)) {
      effects->Refuse(kind.name, "cannot be simulated together with [effects." +
                                     std::string(kind.excludes) + "]; remove one of the two");
    }
    if (!(parts.inner_radius_mm > parts_.radius_mm)) {
      keys.Refuse("inner_radius_mm", "must be more than the wire's radius, " +
                                         std::to_string(parts_.radius_mm) + " mm");
    }
    if (parts.inserted_at_start_mm > 0 && start_path_mm_.empty()) {
      keys.Refuse("inserted_at_start_mm",
                  "needs centerlines to lie along; give the entry as a place on a centerline");
    }
    for (const WireSection& section : parts.sections) {
      parts_.radius_mm = std::max(parts_.radius_mm, section.radius_mm);
    }
    catheter_at_start_mm_ = parts.inserted_at_start_mm;
    catheter_inner_mm_ = parts.inner_radius_mm;
    coaxial_ = std::make_unique<CoaxialPair>(
        *wire_, WireModel(segment_mm, std::move(parts.sections), parts.tip_mm, parts.max_length_mm,
                          law, parts_.sheath));
  }
}

std::vector<WireSection> Scene::Sections(double segment_mm) const {
  const WireParts& p = parts_;
  if (!p.sections.empty()) return p.sections;
  const auto rigidity_at = [&p](double s) {
    if (s <= p.from_tip_mm.front()) return p.rigidity_N_mm2.front();
    for (std::size_t k = 1; k < p.from_tip_mm.size(); ++k) {
      if (s <= p.from_tip_mm[k]) {
        const double t = (s - p.from_tip_mm[k - 1]) / (p.from_tip_mm[k] - p.from_tip_mm[k - 1]);
        return p.rigidity_N_mm2[k - 1] + t * (p.rigidity_N_mm2[k] - p.rigidity_N_mm2[k - 1]);
      }
    }
    return p.rigidity_N_mm2.back();
  };
  // The tip's joints are all equal and have its angle together: the step to the straight shaft
  // falls between two joints.
  const double joints = std::max(1.0, std::floor(p.tip_mm / segment_mm + 0.5));
  const double curvature = p.tip_angle_rad > 0 ? p.tip_angle_rad / (joints * segment_mm) : 0;
  const double tip_end = (joints + 0.5) * segment_mm;
  std::vector<double> stations = p.from_tip_mm;
  if (curvature > 0) {
    stations.insert(stations.end(), {0, tip_end, tip_end + 1e-3 * segment_mm});
  }
  std::sort(stations.begin(), stations.end());
  stations.erase(std::unique(stations.begin(), stations.end()), stations.end());
  std::vector<WireSection> sections;
  for (const double s : stations) {
    sections.push_back({.from_tip_mm = s,
                        .rigidity_N_mm2 = rigidity_at(s),
                        .radius_mm = p.radius_mm,
                        .curvature_1_per_mm = s <= tip_end ? curvature : 0});
  }
  return sections;
}

std::unique_ptr<WireModel> Scene::MakeWire(double segment_mm, BendingLaw law) const {
  std::vector<WireSection> sections = Sections(segment_mm);
  for (const effects::ShapeChange& change : parts_.shapes) change(sections);
  return std::make_unique<WireModel>(segment_mm, std::move(sections), parts_.tip_mm,
                                     parts_.max_length_mm, law, parts_.sheath);
}

void Scene::ReadRelaxation(StrictTable& file) {
  StrictTable* table = file.OptionalTable("relaxation");
  if (table == nullptr) return;
  method_ = table->Choice("method", {"newton", "paper"}, 0) == 0 ? Method::kNewton : Method::kPaper;
  budget_us_ = table->Number("budget_us", 20, 1e6, budget_us_);
  if (method_ == Method::kNewton) {
    newton_.tolerance = table->Number("tolerance", 1e-10, 1, newton_.tolerance);
    wall_.points_per_segment =
        table->Integer("contact_points_per_segment", 1, 8, wall_.points_per_segment);
    budget_units_ = table->Integer("budget_units", 1, 1000000, 1000);
    return;
  }
  wall_.points_per_segment = 1;
  paper_.tolerance = table->Number("tolerance", 1e-10, 1, paper_.tolerance);
  paper_.physical.max_update = table->Number("max_update", 1e-4, 2, paper_.physical.max_update);
  paper_.physical.margin = table->Integer("margin", 1, 1000, paper_.physical.margin);
  const UpdateRule rules[] = {UpdateRule::kSigned, UpdateRule::kRhoOnly, UpdateRule::kAbsolute,
                              UpdateRule::kExactRoot};
  paper_.physical.rule =
      rules[table->Choice("update_rule", {"signed", "rho_only", "absolute", "exact_root"}, 2)];
  budget_units_ = table->Integer("budget_units", 1, 1000000, 100);
}

void Scene::ReadEffects(StrictTable& file) {
  StrictTable* table = file.OptionalTable("effects");
  if (table == nullptr) return;
  for (const std::string& name : table->Keys()) effects::FindEffect(name, table->Where(name));
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (table->Has(kind.name)) MakeEffect(kind, *table);
  }
}

void Scene::MakeEffect(const effects::EffectKind& kind, StrictTable& effects) {
  if (*kind.needs != 0 && !effects.Has(kind.needs)) {
    effects.Refuse(kind.name, "needs [effects." + std::string(kind.needs) +
                                  "], which this scene does not name; add it or remove this");
  }
  effect_names_.emplace_back(kind.name);
  if (kind.make == nullptr) {  // read with the wire
    if (method_ == Method::kPaper && kind.sections == nullptr) {
      effects.Refuse(kind.name,
                     "is not known to the paper's method, whose wire does not twist and is alone; "
                     "remove it or choose relaxation.method = \"newton\"");
    }
    return;
  }
  effects_.push_back(
      kind.make(effects.Table(kind.name), {.wire = wire(),
                                           .wall = wall_,
                                           .field = vessel_.field.get(),
                                           .centerlines = &vessel_.centerlines,
                                           .bounds_mm = vessel_.bounds_mm,
                                           .axes = axes_,
                                           .earlier = &effects_,
                                           .moving = moving_.get(),
                                           .coaxial = coaxial_.get(),
                                           .catheter_inner_mm = catheter_inner_mm_}));
  effects::Effect& effect = *effects_.back();
  EnergyTerm* const term = effect.energy_term();
  const WallStiffness* const stiffness = effect.wall_stiffness();
  vessel::FieldMotion* const motion = effect.motion();
  if (method_ == Method::kPaper && (term != nullptr || stiffness != nullptr || motion != nullptr)) {
    effects.Refuse(kind.name,
                   "changes the energy of the wire, which the paper's method does not know; "
                   "remove it or choose relaxation.method = \"newton\"");
  }
  if (term != nullptr) terms_.push_back(term);
  if (stiffness != nullptr) wall_.by_place = stiffness;
  if (motion != nullptr) {
    if (moving_ == nullptr) moving_ = std::make_unique<vessel::MovingField>(*vessel_.field);
    moving_->Add(*motion);
  }
}

std::unique_ptr<Relaxation> Scene::MakeRelaxation() {
  if (method_ == Method::kPaper) {
    return std::make_unique<PaperRelaxation>(*wire_, *vessel_.field, wall_, paper_);
  }
  const ClearanceField& field = moving_ != nullptr ? *moving_ : *vessel_.field;
  if (coaxial_ != nullptr) {
    return std::make_unique<CoaxialRelaxation>(*coaxial_, InstrumentPlace{inserted_at_start_mm_, 0},
                                               InstrumentPlace{catheter_at_start_mm_, 0}, field,
                                               wall_, newton_, terms_);
  }
  return MakeNewtonRelaxation(*wire_, field, wall_, newton_, terms_);
}

WireState Scene::MakeStart(Relaxation& relaxation) const {
  WireState state(wire());
  const HandTarget here = start();
  const double reach_mm = std::max(here.insertion_mm, here.catheter_insertion_mm);
  if (reach_mm > 0) LayAlong(wire(), start_path_mm_, reach_mm, state);
  relaxation.Restart(state);
  for (int tick = 0; tick < 20; ++tick) {
    CountedBudget budget(budget_units_);
    if (relaxation.Tick(here, budget, state).converged) break;
  }
  return state;
}

}  // namespace torquer::scene
