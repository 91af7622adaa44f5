#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "host/api/impl.h"
#include "host/simulator/command_limits.h"
#include "host/simulator/session_record.h"
#include "protocol/lcm_channels.h"

namespace torquer {

namespace {

constexpr double kRounding_mm = 1e-6;

void Check(const Command& command, const Scene& scene) {
  const std::vector<InstrumentInfo>& instruments = scene.instruments();
  if (command.hands.size() != instruments.size()) {
    throw Error(fmt::format(
        "hands has {} entries, but {} has {} instruments; give one entry per instrument",
        command.hands.size(), scene.name(), instruments.size()));
  }
  for (std::size_t k = 0; k < instruments.size(); ++k) {
    const Hand& hand = command.hands[k];
    if (hand.insertion_mm < -kRounding_mm) {
      throw Error(fmt::format(
          "the hand of {} is at {:g} mm; give 0 or more, its distance past the entry point",
          instruments[k].name, hand.insertion_mm));
    }
    if (simulator::IsValid(InstrumentPose{hand.insertion_mm, hand.rotation_rad})) continue;
    throw Error(fmt::format("the hand of {} is at {} mm and {} rad; give finite values within 1e5",
                            instruments[k].name, hand.insertion_mm, hand.rotation_rad));
  }
  for (const double angle_deg : {command.lao_deg, command.cra_deg}) {
    if (std::abs(angle_deg) <= 180) continue;
    throw Error(fmt::format("an angle of the C-arm is {} degrees; give -180 to 180", angle_deg));
  }
  CheckImaging(command.imaging);
  CheckInjector(command.injector);
  if (const Table& table = command.table; !simulator::IsValid(ToEffects(table))) {
    using Most = effects::Table;
    throw Error(fmt::format(
        "the table is at left_mm {}, head_mm {}, height_mm {}; give -{} to {}, -{} to {}, -{} to "
        "{}",
        table.left_mm, table.head_mm, table.height_mm, Most::kMostLeftMm, Most::kMostLeftMm,
        Most::kMostHeadMm, Most::kMostHeadMm, Most::kMostHeightMm, Most::kMostHeightMm));
  }
}

void CheckTime(double time_s, double before_s, bool begun) {
  if (!std::isfinite(time_s)) {
    throw Error(fmt::format("time_s is {}, not a finite number; give seconds, {} {}", time_s,
                            begun ? "more than" : "at least", before_s));
  }
  if (begun ? time_s > before_s : time_s >= before_s) return;
  throw Error(
      fmt::format("time_s is {}, not later than the previous command at {}; give increasing times",
                  time_s, before_s));
}

std::vector<double> InMilli(const std::vector<double>& values) {
  std::vector<double> out;
  for (const double value : values) out.push_back(1e3 * value);
  return out;
}

}  // namespace

Simulation::Impl::Impl(const Scene& of)
    : scene_at_start(of),
      scene(of),
      lent(of.impl_->Lend()),
      simulation(std::make_unique<simulator::Simulation>(*lent)),
      rows(*simulation),
      pictures(simulation->image_count()),
      pictures_due(simulation->image_count()) {}

Simulation::Impl::Impl(const Impl& other)
    : scene_at_start(other.scene_at_start),
      scene(other.scene),
      lent(scene.impl_->Lend()),
      simulation(std::make_unique<simulator::Simulation>(*lent, *other.simulation)),
      rows(*simulation),
      past(other.past),
      pictures(other.pictures),
      pictures_due(other.pictures_due) {
  rows.CopyFrom(other.rows);
}

Simulation::Simulation(const Scene& scene)
    : impl_(Guarded([&] { return std::make_unique<Impl>(scene); })) {}

Simulation::Impl& Simulation::impl() const {
  if (impl_ == nullptr) {
    throw Error("this simulation object was moved from; use the object that it was moved to");
  }
  return *impl_;
}

Simulation::Simulation(const Simulation& other) {
  const auto look = other.impl().usage.Look();
  impl_ = std::make_unique<Impl>(*other.impl_);
}

Simulation& Simulation::operator=(const Simulation& other) {
  if (this == &other) return *this;
  const auto look = other.impl().usage.Look();
  if (impl_ == nullptr) {
    impl_ = std::make_unique<Impl>(*other.impl_);
    return *this;
  }
  const auto change = impl_->usage.Change();
  const simulator::Simulation& twin = *other.impl_->simulation;
  if (impl_->scene.impl_ == other.impl_->scene.impl_) {
    impl_->simulation->CopyFrom(twin);
  } else {
    auto lent = other.impl_->scene.impl_->Lend();
    auto built = std::make_unique<simulator::Simulation>(*lent, twin);
    impl_->ContinueIn(other.impl_->scene, std::move(lent), std::move(built));
  }
  impl_->scene_at_start = other.impl_->scene_at_start;
  impl_->rows.CopyFrom(other.impl_->rows);
  impl_->past = other.impl_->past;
  impl_->pictures = other.impl_->pictures;
  impl_->pictures_due = other.impl_->pictures_due;
  return *this;
}

Simulation::Simulation(Simulation&&) noexcept = default;
Simulation& Simulation::operator=(Simulation&&) noexcept = default;
Simulation::~Simulation() = default;

const Scene& Simulation::scene() const {
  const auto hold = impl().usage.Look();
  return impl_->scene;
}
const Scene& Simulation::scene_at_start() const {
  const auto hold = impl().usage.Look();
  return impl_->scene_at_start;
}
const Command& Simulation::command() const {
  const auto hold = impl().usage.Look();
  return impl_->rows.command();
}

void Simulation::Impl::Restart() {
  if (exchanged()) {
    auto first = scene_at_start.impl_->Lend();
    auto built = std::make_unique<simulator::Simulation>(*first);
    ContinueIn(scene_at_start, std::move(first), std::move(built));
  } else {
    simulation->Restart();
  }
  rows.Restart();
  past = {};
  pictures.assign(pictures.size(), Picture{});
  pictures_due.assign(pictures.size(), false);
}

void Simulation::Restart() {
  const auto hold = impl().usage.Change();
  impl_->Restart();
}

StepReport Simulation::Step(const Command& command) { return Step(command, {}); }

StepReport Simulation::Step(const Command& command,
                            const std::function<bool(const StepReport& tick)>& after_tick) {
  Impl& all = impl();
  const auto hold = all.usage.Change();
  const double before_s = all.rows.command().time_s;
  CheckTime(command.time_s, before_s, all.rows.begun());
  Check(command, all.scene);
  // Ends the step in the past also if `after_tick` throws.
  struct Recording {
    Past& past;
    ~Recording() { past.EndStep(); }
  };
  all.past.BeginStep(command);
  const Recording recording{all.past};
  return all.rows.GoTo(command, [&](const StepReport& tick) {
    all.past.AddTick();
    for (std::size_t k = 0; k < all.pictures_due.size(); ++k) {
      if (all.simulation->picture_due(k)) all.pictures_due[k] = true;
    }
    return !after_tick || after_tick(tick);
  });
}

StepReport Simulation::StepRow(const ScriptRow& row,
                               const std::function<bool(const StepReport& tick)>& after_tick) {
  WhileStill([&] {
    CheckTime(row.command.time_s, impl_->rows.command().time_s, impl_->rows.begun());
    Check(row.command, impl_->scene);
  });
  for (const auto& [instrument, device] : row.exchanges) {
    try {
      Exchange(scene().instruments().at(instrument).name, device);
    } catch (const Error& error) {
      throw Error(row.place + ": " + error.what());
    }
  }
  return Step(row.command, after_tick);
}

void Simulation::WhileStill(const std::function<void()>& look) const {
  const auto hold = impl().usage.Look();
  look();
}

double Simulation::time_s() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->time_s();
}

const double* Simulation::nodes_mm() const {
  const auto hold = impl().usage.Look();
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
  return impl_->simulation->state().Farthest().nodes().front().data();
}

std::size_t Simulation::node_count() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->state().Farthest().nodes().size();
}

std::vector<Point> Simulation::InstrumentNodesMm(std::size_t instrument) const {
  const auto hold = impl().usage.Look();
  CheckInstrument(instrument, impl_->scene);
  const WireState& state = impl_->simulation->state();
  const int k = static_cast<int>(instrument);
  std::vector<Eigen::Vector3d> part;
  TakeNodes(impl_->lent->stack().instrument(k), state.CurveOf(k), state.poses()[k].insertion_mm,
            part);
  std::vector<Point> nodes;
  nodes.reserve(part.size());
  for (const Eigen::Vector3d& node : part) nodes.push_back(ToPoint(node));
  return nodes;
}

std::vector<InstrumentState> Simulation::instruments() const {
  const auto hold = impl().usage.Look();
  const simulator::Simulation& simulation = *impl_->simulation;
  const InstrumentPoses& poses = simulation.state().poses();
  const InstrumentPoses& carried = simulation.report().carried;
  std::vector<InstrumentState> all;
  for (int k = 0; k < poses.size(); ++k) {
    const Eigen::Vector3d tip = PointAt(impl_->lent->stack().instrument(k),
                                        simulation.state().CurveOf(k), poses[k].insertion_mm);
    all.push_back({.hand = {poses[k].insertion_mm, poses[k].rotation_rad},
                   .carried = {carried[k].insertion_mm, carried[k].rotation_rad},
                   .tip_mm = ToPoint(tip)});
  }
  return all;
}

double Simulation::energy_mJ() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->report().energy_mJ;
}
double Simulation::dissipated_mJ() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->report().dissipated_mJ;
}
double Simulation::residual() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->report().residual;
}
double Simulation::SolverErrorMm() {
  const auto hold = impl().usage.Work();
  return impl_->simulation->SolverErrorMm();
}
double Simulation::DiscretizationErrorMm() {
  const auto hold = impl().usage.Work();
  return impl_->simulation->DiscretizationErrorMm();
}
double Simulation::max_penetration_mm() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->report().max_penetration_mm;
}
bool Simulation::outside_lumen() const {
  const auto hold = impl().usage.Look();
  return (impl_->simulation->status() & protocol::kWireOutsideLumen) != 0;
}

std::vector<Contact> Simulation::contacts() const {
  const auto hold = impl().usage.Look();
  std::vector<Contact> all;
  const auto add = [&all](int node, double penetration_mm) {
    all.push_back({static_cast<std::size_t>(node), penetration_mm});
  };
  impl_->simulation->VisitContacts(impl_->simulation->state().FarthestCurve(), add);
  return all;
}

std::vector<Contact> Simulation::InstrumentContacts(std::size_t instrument) const {
  const auto hold = impl().usage.Look();
  CheckInstrument(instrument, impl_->scene);
  const WireState& state = impl_->simulation->state();
  const int k = static_cast<int>(instrument);
  const int last = NodesBefore(impl_->lent->stack().instrument(k), state.CurveOf(k),
                               state.poses()[k].insertion_mm);
  std::vector<Contact> all;
  const auto add = [&](int node, double penetration_mm) {
    // Beyond its tip the curve has another instrument.
    if (node <= last) all.push_back({static_cast<std::size_t>(node), penetration_mm});
  };
  impl_->simulation->VisitContacts(impl_->lent->stack().CurveOf(k), add);
  return all;
}

std::uint64_t Simulation::state_hash() const {
  const auto hold = impl().usage.Look();
  return impl_->simulation->state_hash();
}

std::vector<Reading> Simulation::readings() const {
  const auto hold = impl().usage.Look();
  std::vector<Reading> all;
  for (effects::Reading& reading : impl_->simulation->Readings()) {
    all.push_back({std::move(reading.name), reading.value});
  }
  return all;
}

std::string Simulation::Record() const {
  const auto hold = impl().usage.Look();
  return simulator::FormatRecord(*impl_->simulation, false);
}

Forces Simulation::forces() const {
  const auto hold = impl().usage.Look();
  Forces out;
  const InternalForces* const forces = impl_->simulation->forces();
  if (forces == nullptr) {
    throw Error(impl_->scene.name() +
                ": has no forces along the wire; add [effects.internal_forces]");
  }
  for (const Eigen::Vector3d& f : forces->contact_N) out.contact_mN.push_back(ToPoint(1e3 * f));
  out.line_load_mN_mm = InMilli(forces->line_load_N_mm);
  out.tension_mN = InMilli(forces->tension_N);
  out.bending_mN_mm = InMilli(forces->bending_mJ);
  out.twisting_mN_mm = InMilli(forces->twisting_mJ);
  return out;
}

}  // namespace torquer
