#include "host/simulator/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <limits>

#include "host/simulator/command_limits.h"
#include "host/simulator/wire_status.h"
#include "host/support/error.h"
#include "protocol/lcm_channels.h"

namespace torquer::simulator {

namespace {

// True if the center of a point that touches the wall is beyond it.
bool LeavesLumen(const PointSet& points) {
  for (std::size_t q = 0; q < points.touches.size(); ++q) {
    if (points.touches[q] && points.clearance[q].clearance_mm < 0) return true;
  }
  return false;
}

// The rest of a tick's budget after the parts before.
class RestOfBudget final : public WorkBudget {
 public:
  RestOfBudget(WorkBudget& whole, int done) : whole_(whole), done_(done) {}
  bool Allows(int done) override { return whole_.Allows(done_ + done); }

 private:
  WorkBudget& whole_;
  const int done_;
};

// Adds the report of a part of a tick to the report of the previous parts.
void AddPart(TickReport part, TickReport& sum) {
  part.actions += sum.actions;
  part.work += sum.work;
  part.iterations += sum.iterations;
  part.updates += sum.updates;
  part.snapped = part.snapped || sum.snapped;
  sum = part;
}

// Position in a message.
std::vector<float> Rounded(const Eigen::Vector3d& x) {
  return {static_cast<float>(x[0]), static_cast<float>(x[1]), static_cast<float>(x[2])};
}

bool IsValid(const InstrumentPoses& target) {
  return std::all_of(target.begin(), target.end(),
                     [](const InstrumentPose& pose) { return simulator::IsValid(pose); });
}

}  // namespace

Simulation::Simulation(scene::Scene& scene, EffectPrices* prices)
    : scene_(scene),
      relaxation_(scene.MakeRelaxation([prices](std::size_t effect, EnergyTerm* term) {
        return prices == nullptr ? term : prices->Watch(effect, term);
      })),
      prices_(prices),
      state_(scene.stack().empty_rod(), scene.stack().size()) {
  FindRoles();
  Restart();
}

Simulation::Simulation(scene::Scene& scene, const Simulation& twin)
    : scene_(scene),
      relaxation_(scene.MakeRelaxation()),
      state_(scene.stack().empty_rod(), scene.stack().size()) {
  FindRoles();
  CopyFrom(twin);
}

void Simulation::FindRoles() {
  for (std::size_t k = 0; k < scene_.effects().size(); ++k) {
    effects::Effect& effect = *scene_.effects()[k];
    if (effects::Timed* timed = effect.timed()) timed_.push_back(timed);
    if (effects::Evolution* evolution = effect.evolution()) evolutions_.push_back({evolution, k});
    if (effects::Observer* observer = effect.observer()) {
      observers_.push_back({observer, k});
      if (observer->AlongWire() != nullptr) along_wire_ = observer;
      if (observer->Vitals() != nullptr) patient_ = observer;
    }
    if (effects::ImageSource* image = effect.image()) images_.push_back({image, k});
    if (effects::MotionLimit* limit = effect.limit()) limit_ = limit;
  }
  pictures_due_.resize(images_.size());
  is_time_dependent_ = scene_.moving_field() != nullptr || !timed_.empty() ||
                       !evolutions_.empty() || !images_.empty();
}

void Simulation::Restart() {
  time_s_ = 0;
  for (const std::unique_ptr<effects::Effect>& effect : scene_.effects()) effect->Restart();
  if (scene_.moving_field() != nullptr) scene_.moving_field()->SetTime(0);
  if (tracker_ != nullptr) tracker_->Restart();
  bool is_relaxed = false;
  state_ = scene_.MakeStart(*relaxation_, &is_relaxed);
  target_ = scene_.start();
  controls_ = {};
  done_.clear();
  tick_ = 0;
  updates_ = 0;
  status_ = 0;
  report_ = TickReport();
  report_.carried = InstrumentPoses(target_.size());
  report_.residual = relaxation_->Current().residual;
  report_.energy_mJ = relaxation_->EnergyMJ(state_);
  report_.dissipated_mJ = relaxation_->Current().dissipated_mJ;
  report_.max_penetration_mm = relaxation_->Current().max_penetration_mm;
  Observe();
  RunEffects(0, effects::Controls(), is_relaxed);
}

void Simulation::CopyFrom(const Simulation& twin) {
  assert(scene_.names_of_effects() == twin.scene_.names_of_effects());
  assert(scene_.start() == twin.scene_.start());
  for (std::size_t k = 0; k < scene_.effects().size(); ++k) {
    scene_.effects()[k]->CopyFrom(*twin.scene_.effects()[k]);
  }
  // The curve of a lone wire has room for the wire's own bend. One that was exchanged is withdrawn.
  const bool has_room = state_.reference_twist().size() == twin.state_.reference_twist().size();
  state_ = has_room ? twin.state_
                    : WireState::Along(scene_.stack().empty_rod(), {}, twin.state_.poses());
  relaxation_->CopyFrom(*twin.relaxation_, state_);
  CopyTracker(twin);
  report_ = twin.report_;
  time_s_ = twin.time_s_;
  target_ = twin.target_;
  controls_ = twin.controls_;
  done_ = twin.done_;
  tick_ = twin.tick_;
  updates_ = twin.updates_;
  hash_ = twin.hash_;
  status_ = twin.status_;
  pictures_due_ = twin.pictures_due_;
}

void Simulation::CheckExchange(int instrument) const {
  const std::string& name = scene_.instruments()[static_cast<std::size_t>(instrument)].name;
  const double inserted_mm = state_.poses()[instrument].insertion_mm;
  const double commanded_mm = target_[instrument].insertion_mm;
  if (inserted_mm > 0 || commanded_mm > 0) {
    throw UserError(
        fmt::format("{} is inserted by {:g} mm, with its hand at {:g} mm, and cannot be exchanged; "
                    "withdraw it to 0 mm first",
                    name, inserted_mm, commanded_mm));
  }
  if (tracker_ == nullptr) return;
  throw UserError(
      fmt::format("{} cannot be exchanged while derivatives are tracked; end the tracking at the "
                  "start of the scene first",
                  name));
}

const TickReport& Simulation::Tick(const Command& command, WorkBudget& budget) {
  status_ = command.in_doubt ? protocol::kWireInDoubt : 0;
  const bool poses = IsValid(command.target);
  // X-ray system and power injector have no meaning in a scene that has none.
  const bool controls = IsValid(command.controls) &&
                        (images_.empty() || IsValid(command.controls.imaging)) &&
                        (evolutions_.empty() || InvalidValue(command.controls.injector).empty());
  if (poses) target_ = command.target;
  if (controls) controls_ = command.controls;
  if (!poses || !controls || command.refused) status_ |= protocol::kWireInputRefused;
  const double before_s = time_s_;
  time_s_ = command.time_s < 0 ? time_s_ + 1e-3 : std::max(time_s_, command.time_s);
  if (scene_.moving_field() != nullptr) scene_.moving_field()->SetTime(time_s_);
  for (effects::Timed* timed : timed_) timed->AdvanceTime(time_s_ - before_s);
  if (tracker_ != nullptr) tracker_->AdvanceTime(time_s_, time_s_ - before_s);
  Relax(budget);
  ++tick_;
  done_.push_front({target_, time_s_, report_.work});
  // Keeps one more than a message's past, because the newest tick has its own fields.
  if (done_.size() > kMostPastInMessage + 1) done_.pop_back();
  updates_ += report_.updates;
  Observe();
  if (tracker_ != nullptr) {
    tracker_->Look(report_, (status_ & protocol::kWireOutsideLumen) != 0);
  }
  RunEffects(time_s_ - before_s, controls_);
  return report_;
}

void Simulation::TrackSensitivities(const std::vector<std::string>& keys) {
  assert(tick_ == 0);
  std::unique_ptr<SensitivityTracker> tracker;
  if (!keys.empty()) {
    tracker = std::make_unique<SensitivityTracker>(scene_, relaxation_->rods()[0], keys);
  }
  relaxation_->Follow(tracker == nullptr ? nullptr : &tracker->follower());
  tracker_ = std::move(tracker);
  if (tracker_ != nullptr) Restart();
}

void Simulation::CopyTracker(const Simulation& twin) {
  if (twin.tracker_ == nullptr) {
    relaxation_->Follow(nullptr);
    tracker_.reset();
    return;
  }
  if (tracker_ == nullptr || tracker_->keys() != twin.tracker_->keys()) {
    tracker_ =
        std::make_unique<SensitivityTracker>(scene_, relaxation_->rods()[0], twin.tracker_->keys());
    relaxation_->Follow(&tracker_->follower());
  }
  tracker_->CopyFrom(*twin.tracker_);
}

void Simulation::Relax(WorkBudget& budget) {
  if (prices_ != nullptr) prices_->BeginTick();
  if (prices_ == nullptr || !prices_->measures()) {
    report_ = RelaxToTarget(budget);
  } else {
    report_ = prices_->MeasureSolver([&] { return RelaxToTarget(budget); });
  }
}

// With a limit, the motion of a tick has parts, so that an instrument stops where it must.
TickReport Simulation::RelaxToTarget(WorkBudget& budget) {
  if (limit_ == nullptr) return relaxation_->Tick(target_, budget, state_);
  TickReport sum;
  while (true) {
    InstrumentPoses part = target_;
    const bool is_left = limit_->Limit(state_, part);
    const InstrumentPoses before = state_.poses();
    RestOfBudget rest(budget, sum.work);
    AddPart(relaxation_->Tick(part, rest, state_), sum);
    limit_->Look(state_);
    if (!is_left || sum.budget_spent || state_.poses() == before) break;
  }
  // The last part had a nearer goal.
  sum.carried = MotionLeft(goal(), state_.poses());
  return sum;
}

InstrumentPoses Simulation::goal() const {
  InstrumentPoses goal = scene_.stack().Bounded(target_);
  if (limit_ != nullptr) limit_->Hold(goal);
  return goal;
}

template <class Act>
void Simulation::Priced(std::size_t effect, Act&& act) {
  if (prices_ == nullptr || !prices_->measures()) {
    act();
  } else {
    prices_->Measure(effect, act);
  }
}

void Simulation::RunEffects(double step_s, const effects::Controls& controls,
                            bool relaxed_at_start) {
  if (evolutions_.empty() && observers_.empty() && images_.empty()) return;
  const effects::TickView tick{.time_s = time_s_,
                               .step_s = step_s,
                               .controls = controls,
                               .target = target_,
                               .state = state_,
                               .quadratic = relaxation_->Current(),
                               .report = report_,
                               .rods = &relaxation_->rods(),
                               .relaxed_at_start = relaxed_at_start};
  for (const auto& [evolution, effect] : evolutions_) {
    Priced(effect, [&, role = evolution] { role->Advance(tick); });
  }
  for (const auto& [observer, effect] : observers_) {
    Priced(effect, [&, role = observer] { role->Observe(tick); });
  }
  if (tracker_ != nullptr) tracker_->Observe(tick);
  for (std::size_t k = 0; k < images_.size(); ++k) {
    Priced(images_[k].effect, [&] { pictures_due_[k] = images_[k].role->Take(tick); });
  }
}

double Simulation::longest_tick_s() const {
  constexpr double kLongestWithInertiaS = 1e-3;
  if (!timed_.empty()) return std::min(kLongestWithInertiaS, scene_.longest_tick_s());
  if (scene_.moving_field() != nullptr || !evolutions_.empty()) return scene_.longest_tick_s();
  return std::numeric_limits<double>::infinity();
}

std::vector<effects::Reading> Simulation::Readings() const {
  std::vector<effects::Reading> all;
  for (const EffectRole<effects::Observer>& observer : observers_) {
    for (effects::Reading& reading : observer.role->Readings()) all.push_back(std::move(reading));
  }
  return all;
}

void Simulation::Observe() {
  hash_ = relaxation_->Hash(HashState(state_));
  const QuadraticModel& current = relaxation_->Current();
  const bool outside_lumen =
      LeavesLumen(current.points) ||
      std::any_of(current.around.begin(), current.around.end(),
                  [](const CurveQuadraticModel& curve) { return LeavesLumen(curve.points); });
  status_ |= StatusBits(report_, outside_lumen);
  if (limit_ == nullptr) return;
  hash_ = limit_->Hash(hash_);
  if (limit_->left_model()) status_ |= protocol::kWireLeftModel;
}

void Simulation::Describe(torquer_lcm::wire_state_t& out) const {
  out.tick = tick_;
  out.time_s = time_s_;
  out.energy_mJ = report_.energy_mJ;
  out.residual = report_.residual;
  out.max_penetration_um = 1e3 * report_.max_penetration_mm;
  out.actions = report_.actions;
  out.work = report_.work;
  out.updates = updates_;
  out.state_hash = static_cast<std::int64_t>(hash_);
  out.status = status_;
  DescribeInstruments(out);
  DescribeShape(out);
  DescribeContacts(out);
  DescribePast(out);
}

void Simulation::DescribeInstruments(torquer_lcm::wire_state_t& out) const {
  const InstrumentPoses& poses = state_.poses();
  const InstrumentPoses start = scene_.start();
  out.instruments.resize(static_cast<std::size_t>(poses.size()));
  out.instrument_count = poses.size();
  for (int k = 0; k < poses.size(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    const Curve& curve = state_.CurveOf(k);
    torquer_lcm::instrument_state_t& instrument = out.instruments[at];
    instrument.name = scene_.instruments()[at].name;
    instrument.inserted_at_start_mm = start[k].insertion_mm;
    instrument.commanded_insertion_mm = target_[k].insertion_mm;
    instrument.commanded_rotation_rad = target_[k].rotation_rad;
    instrument.insertion_mm = poses[k].insertion_mm;
    instrument.rotation_rad = poses[k].rotation_rad;
    // With less than half a segment inside there is no segment yet, and the whole insertion is
    // carried.
    instrument.carried_mm =
        target_[k].insertion_mm - (curve.segments() > 0 ? poses[k].insertion_mm : 0);
    instrument.carried_rad = target_[k].rotation_rad - poses[k].rotation_rad;
    const Eigen::Vector3d tip = PointAt(scene_.stack().instrument(k), curve, poses[k].insertion_mm);
    for (int axis = 0; axis < 3; ++axis) instrument.tip_mm[axis] = tip[axis];
    DescribeOwnNodes(k, instrument);
  }
}

// Nodes of an instrument that does not lie on curve 0.
void Simulation::DescribeOwnNodes(int k, torquer_lcm::instrument_state_t& out) const {
  out.nodes_mm.clear();
  const Curve& curve = state_.CurveOf(k);
  if (&curve != &state_.curve(0)) {
    const double insertion_mm = state_.poses()[k].insertion_mm;
    const int n = NodesBefore(scene_.stack().instrument(k), curve, insertion_mm);
    const int stride = n / kMostOwnNodesInMessage + 1;
    for (int i = 0; i < n; i += stride) {
      out.nodes_mm.push_back(Rounded(curve.nodes()[static_cast<std::size_t>(i)]));
    }
    out.nodes_mm.push_back(Rounded(PointAt(scene_.stack().instrument(k), curve, insertion_mm)));
  }
  out.node_count = static_cast<std::int32_t>(out.nodes_mm.size());
}

void Simulation::DescribeShape(torquer_lcm::wire_state_t& out) const {
  const std::vector<Eigen::Vector3d>& nodes = state_.nodes();
  const int n = state_.segments();
  out.segment_count = n;
  out.stride = n / kMostNodesInMessage + 1;
  out.nodes_mm.clear();
  for (int i = 0; i < n; i += out.stride) {
    out.nodes_mm.push_back(Rounded(nodes[static_cast<std::size_t>(i)]));
  }
  out.nodes_mm.push_back(Rounded(nodes.back()));
  out.node_count = static_cast<std::int32_t>(out.nodes_mm.size());
}

void Simulation::VisitContacts(
    int curve, const std::function<void(int node, double penetration_mm)>& visit) const {
  const PointSet& points = relaxation_->Current().curve(curve).points;
  for (int i = 0; i < state_.curve(curve).segments(); ++i) {
    double deepest_mm = 0;
    for (int k = 0; k < points.per_segment; ++k) {
      const auto q = static_cast<std::size_t>(i * points.per_segment + k);
      if (q >= points.touches.size() || !points.touches[q]) continue;
      deepest_mm = std::max(deepest_mm, points.radius_mm[q] - points.clearance[q].clearance_mm);
    }
    if (deepest_mm > 0) visit(i + 1, deepest_mm);
  }
}

void Simulation::DescribeContacts(torquer_lcm::wire_state_t& out) const {
  out.contact_nodes.clear();
  out.contact_penetrations_um.clear();
  VisitContacts(0, [&out](int node, double penetration_mm) {
    out.contact_nodes.push_back(node);
    out.contact_penetrations_um.push_back(static_cast<float>(1e3 * penetration_mm));
  });
  out.contact_count = static_cast<std::int32_t>(out.contact_nodes.size());
}

void Simulation::DescribePast(torquer_lcm::wire_state_t& out) const {
  const std::size_t past = done_.empty() ? 0 : done_.size() - 1;
  out.past_count = static_cast<std::int32_t>(past);
  out.past_time_s.resize(past);
  out.past_work.resize(past);
  out.past_insertion_mm.resize(past);
  out.past_rotation_rad.resize(past);
  for (std::size_t k = 0; k < past; ++k) {
    const Done& done = done_[k + 1];
    out.past_time_s[k] = done.time_s;
    out.past_work[k] = done.work;
    out.past_insertion_mm[k].clear();
    out.past_rotation_rad[k].clear();
    for (const InstrumentPose& pose : done.target) {
      out.past_insertion_mm[k].push_back(pose.insertion_mm);
      out.past_rotation_rad[k].push_back(pose.rotation_rad);
    }
  }
}

}  // namespace torquer::simulator
