#include "host/simulator/simulation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <limits>

#include "host/simulator/coarse_scene.h"
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

// Relaxation of a scene whose effects are measured; null: no measurement.
std::unique_ptr<Relaxation> Watched(scene::Scene& scene, EffectPrices* prices) {
  return scene.MakeRelaxation([prices](std::size_t effect, EnergyTerm* term) {
    return prices == nullptr ? term : prices->Watch(effect, term);
  });
}

bool IsValid(const InstrumentPoses& target) {
  return std::all_of(target.begin(), target.end(),
                     [](const InstrumentPose& pose) { return simulator::IsValid(pose); });
}

}  // namespace

Simulation::Simulation(scene::Scene& scene, EffectPrices* prices)
    : scene_(scene),
      relaxation_(Watched(scene, prices)),
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

Simulation::Simulation(scene::Scene& scene, const Simulation& before, int instrument)
    : scene_(scene),
      relaxation_(Watched(scene, before.prices_)),
      prices_(before.prices_),
      state_(scene.stack().empty_rod(), scene.stack().size()) {
  FindRoles();
  CopyFrom(before);
  exchanges_.push_back({tick_, time_s_, instrument,
                        scene.spec().instruments[static_cast<std::size_t>(instrument)].device,
                        scene.content_hash()});
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
  for (std::size_t k = 0; k < scene_.effects().size(); ++k) {
    effects::Comparison* comparison = scene_.effects()[k]->comparison();
    if (comparison == nullptr) continue;
    comparison_ = {comparison, k};
    coarse_scene_ = MakeCoarseScene(scene_, scene_.names_of_effects()[k]);
    coarse_ = std::make_unique<Simulation>(*coarse_scene_);
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
  if (coarse_ != nullptr) coarse_->Restart();
  exchanges_.clear();
  hash_at_start_ = scene_.content_hash();
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
  if (coarse_ != nullptr) coarse_->CopyFrom(*twin.coarse_);
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
  exchanges_ = twin.exchanges_;
  hash_at_start_ = twin.hash_at_start_;
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
  if (coarse_ != nullptr) {
    Priced(comparison_.effect, [&] {
      CountedBudget coarse_budget(coarse_scene_->budget_units());
      coarse_->Tick(command, coarse_budget);
    });
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

effects::TickView Simulation::View(double step_s, const effects::Controls& controls,
                                   bool relaxed_at_start) const {
  return {.time_s = time_s_,
          .step_s = step_s,
          .controls = controls,
          .target = target_,
          .state = state_,
          .quadratic = relaxation_->Current(),
          .report = report_,
          .rods = &relaxation_->rods(),
          .relaxed_at_start = relaxed_at_start};
}

void Simulation::RunEffects(double step_s, const effects::Controls& controls,
                            bool relaxed_at_start) {
  if (evolutions_.empty() && observers_.empty() && images_.empty()) return;
  const effects::TickView tick = View(step_s, controls, relaxed_at_start);
  if (coarse_ != nullptr) {
    Priced(comparison_.effect, [&] {
      comparison_.role->Compare(tick, coarse_->View(step_s, controls, relaxed_at_start));
    });
  }
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

}  // namespace torquer::simulator
