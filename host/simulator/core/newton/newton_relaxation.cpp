#include "host/simulator/core/newton/newton_relaxation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {
// An equilibrium that is stable with this weight counts as stable.
constexpr double kStableWeight = 1e-6;
// Turn of a segment, rad, that pushes a wire off an unstable equilibrium.
constexpr double kPush = 1e-4;

// Fraction of the remaining motion in one part. All motions are proportional, so the longest one
// defines it, counted in parts of `feed_mm` and `turn_rad`. A tiny motion would consist only of
// rounding.
double ShareOfWay(const InstrumentPlaces& here, const InstrumentPlaces& next,
                  const InstrumentPlaces& goal, double feed_mm, double turn_rad) {
  double longest = 0;
  double share = 1;
  const auto take = [&](double from, double to, double end, double part) {
    const double parts = std::abs(end - from) / part;
    if (parts <= longest) return;
    longest = parts;
    share = (to - from) / (end - from);
  };
  for (int k = 0; k < here.size(); ++k) {
    take(here[k].insertion_mm, next[k].insertion_mm, goal[k].insertion_mm, feed_mm);
    take(here[k].rotation_rad, next[k].rotation_rad, goal[k].rotation_rad, turn_rad);
  }
  return share;
}

// Number of segments that the second curve lacks against the first.
int ShortBy(const WireState& state) {
  return state.second() == nullptr ? 0 : state.segments() - state.second()->segments();
}

// Largest displacement of a node by a step, plus its `shift_mm` if given.
double LongestMm(const WireModel& model, const WireState& curve, const Expansion& at,
                 const CurveStep& step, const std::vector<Vector3d>* shift_mm = nullptr) {
  const auto n = static_cast<std::size_t>(curve.segments());
  if (n == 0) return 0;
  double squared = 0;
  for (std::size_t i = 0; i <= n; ++i) {
    Vector3d moved_mm;
    if (i < n) {
      moved_mm = step.displacement_mm[i];
    } else {
      const double last_mm = curve.SegmentLength(model, curve.segments() - 1);
      moved_mm = step.displacement_mm.back() + at.frames.back() * (last_mm * step.xi.back());
    }
    if (shift_mm != nullptr) moved_mm += (*shift_mm)[i];
    squared = std::max(squared, moved_mm.squaredNorm());
  }
  return std::sqrt(squared);
}
}  // namespace

template <class Sweep>
NewtonMethod<Sweep>::NewtonMethod(const WireModel& wire, const ClearanceField& field,
                                  const WallModel& wall, const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : NewtonMethod(std::in_place, wire, field, wall, settings, terms) {}

template <class Sweep>
NewtonMethod<Sweep>::NewtonMethod(InstrumentStack& stack, const ClearanceField& field,
                                  const WallModel& wall, const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : NewtonMethod(std::in_place, stack, field, wall, settings, terms) {}

template <class Sweep>
template <class Wires>
NewtonMethod<Sweep>::NewtonMethod(std::in_place_t /*both*/, Wires& wires,
                                  const ClearanceField& field, const WallModel& wall,
                                  const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : Relaxation(wires),
      model_(stack().rod()),
      field_(field),
      settings_(settings),
      terms_(terms),
      two_curves_(stack().second_rod() != nullptr),
      mechanics_(model_, field, wall, terms, two_curves_ ? &stack() : nullptr),
      sweep_(MakeSweep(model_.max_segments(), stack().second_rod())),
      active_set_(mechanics_.points().capacity()),
      between_set_(two_curves_ ? mechanics_.points().capacity() + 1 : 0),
      prediction_(model_),
      current_(mechanics_.MakeExpansion()),
      trial_expansion_(mechanics_.MakeExpansion()),
      trial_(model_, stack().size()) {
  assert(kFront == (two_curves_ || model_.stack_twists()));
  assert(kFront || kTwists == model_.twists());
  const auto room = static_cast<std::size_t>(model_.max_segments()) + 1;
  if (two_curves_) {
    trial_.LaySecond(*stack().second_rod(), 0, stack().clearance().first_outer, false);
    second_push_.reserve(room);
    second_push_spin_.reserve(room * kMostInstruments);
  }
  step_.reserve(room);
  displacement_mm_.reserve(room);
  if (!kTwists && !kFront) defect_.Reserve(model_.max_segments());
  // Two curves may exchange roles, and then the numbers of their spins.
  spin_step_.reserve(room * (kFront ? kMostInstruments : model_.spins()));
  if (kFront && model_.spins() > 0 && !terms.empty()) {
    balance_.Reserve(model_.max_segments(), wall.points_per_segment);
  }
}

template <class Sweep>
void NewtonMethod<Sweep>::Restart(WireState& state) {
  if (kFront && two_curves_) {
    state.LaySecond(*stack().second_rod(), stack().SecondReach(state.places()),
                    stack().clearance().first_outer, stack().OuterLeads(state.places()));
  }
  stack().Combine(state.places(), ShortBy(state));
  mechanics_.points().TakeRadii();
  mechanics_.points().Forget();
  mechanics_.points().TakeStiffness(state);
  for (EnergyTerm* term : terms_) term->Reset();
  active_set_.Forget();
  damping_.Forget();
  prediction_.Forget();
  attempting_ = moved_ = stalled_ = pushed_ = stable_ = part_open_ = part_moved_ = false;
  iterations_since_move_ = 0;
  travel_mm_ = field_.TravelMm();
  mechanics_.Expand(state, current_);
  up_to_date_ = true;
}

template <class Sweep>
void NewtonMethod<Sweep>::CopyFrom(const Relaxation& twin, const WireState& state) {
  const auto& from = dynamic_cast<const NewtonMethod&>(twin);
  stack().Combine(state.places(), ShortBy(state));
  mechanics_.points().CopyFrom(from.mechanics_.points());
  active_set_ = from.active_set_;
  damping_ = from.damping_;
  prediction_ = from.prediction_;
  current_ = from.current_;
  travel_mm_ = from.travel_mm_;
  iterations_since_move_ = from.iterations_since_move_;
  up_to_date_ = from.up_to_date_;
  attempting_ = from.attempting_;
  moved_ = from.moved_;
  stalled_ = from.stalled_;
  pushed_ = from.pushed_;
  part_open_ = from.part_open_;
  part_moved_ = from.part_moved_;
  stable_ = from.stable_;
}

template <class Sweep>
std::uint64_t NewtonMethod<Sweep>::Hash(std::uint64_t seed) const {
  for (const EnergyTerm* term : terms_) seed = term->Hash(seed);
  seed = damping_.Hash(prediction_.Hash(seed));
  // State that a tick interrupted by the budget passes on to the next.
  seed = HashDouble(iterations_since_move_, seed);
  for (const bool flag : {attempting_, stable_, stalled_, pushed_, part_open_, part_moved_}) {
    seed = HashDouble(flag ? 1 : 0, seed);
  }
  if (attempting_) seed = damping_.HashAttempt(seed);
  if (moved_) seed = active_set_.Hash(seed);
  return seed;
}

template <class Sweep>
void NewtonMethod<Sweep>::ExpandTrueLoads(const WireState& state) {
  BringUpToDate(state);
  if (!attempting_) return;
  // Restores the loads of the state, which those of the model had replaced.
  BeginModel(state, false);
}

template <class Sweep>
double NewtonMethod<Sweep>::SolverErrorMm(const WireState& state) {
  if (state.segments() == 0) return 0;
  ExpandTrueLoads(state);
  if (!sweep_.Factor(model_, state, current_, 0)) return std::numeric_limits<double>::quiet_NaN();
  sweep_.Step(model_, state, current_, step_, spin_step_, displacement_mm_);
  double longest_mm = LongestMm(model_, state, current_, {step_, displacement_mm_});
  if constexpr (kFront) {
    if (two_curves_) {
      longest_mm = std::max(
          longest_mm, LongestMm(*stack().second_rod(), *state.second(), current_.second.front(),
                                {sweep_.second_step(), sweep_.second_displacement_mm()}));
    }
  }
  return longest_mm;
}

template <class Sweep>
double NewtonMethod<Sweep>::DiscretizationErrorMm(const WireState& state) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  // Terms with memory depend on the path, not on the position alone.
  const bool remembers = std::any_of(terms_.begin(), terms_.end(),
                                     [](const EnergyTerm* term) { return term->Dissipates(); });
  if (kTwists || kFront || remembers) return kUnknown;
  if (state.segments() == 0) return 0;
  ExpandTrueLoads(state);
  // The set of touching points, and the sinking-in of a tip, are no smooth functions of the mesh.
  if (current_.max_penetration_mm > 0) return kUnknown;
  trial_expansion_ = current_;
  defect_.Put(model_, state, trial_expansion_);
  if (!sweep_.Factor(model_, state, trial_expansion_, 0)) return kUnknown;
  sweep_.Step(model_, state, trial_expansion_, step_, spin_step_, displacement_mm_);
  return LongestMm(model_, state, current_, {step_, displacement_mm_}, &defect_.shift_mm());
}

template <class Sweep>
bool NewtonMethod<Sweep>::Arrived(const InstrumentPlaces& goal, const WireState& state) const {
  return state.places() == goal;
}

template <class Sweep>
void NewtonMethod<Sweep>::Begin(WireState& state) {
  // Continues an interrupted part as it was begun, unless the vessel has moved since.
  const bool still = field_.TravelMm() == travel_mm_;
  if (!part_open_ || !still) {
    BeginPart(state);
    stalled_ = pushed_ = false;
  }
  up_to_date_ = up_to_date_ && still;
  travel_mm_ = field_.TravelMm();
}

// Contact forces are undefined until the solver has converged, so none are given.
template <class Sweep>
void NewtonMethod<Sweep>::FindPressed(const WireState& state) {
  const auto between = std::find_if(terms_.begin(), terms_.end(), [](const EnergyTerm* term) {
    return term->SlidingBetween() != nullptr;
  });
  if (between == terms_.end()) return;
  current_.points.pressed_N.clear();
  if (current_.residual > std::max(settings_.part_tolerance, settings_.tolerance)) return;
  balance_.FindPressed(stack(), state, current_, *(*between)->SlidingBetween(),
                       current_.points.pressed_N);
}

template <class Sweep>
void NewtonMethod<Sweep>::BeginPart(const WireState& state) {
  if (kFront && model_.spins() > 0) FindPressed(state);
  for (EnergyTerm* term : terms_) term->Begin(current_.points);
  part_open_ = true;
  part_moved_ = false;
  // Begin of the terms may have changed the energy.
  up_to_date_ = up_to_date_ && terms_.empty();
}

template <class Sweep>
void NewtonMethod<Sweep>::EndPart() {
  for (EnergyTerm* term : terms_) term->End(current_.points);
  part_open_ = false;
}

template <class Sweep>
void NewtonMethod<Sweep>::BringUpToDate(const WireState& state) {
  if (!up_to_date_) mechanics_.Expand(state, current_);
  up_to_date_ = true;
}

// A wire that the budget left moved but not relaxed is relaxed before the next move.
template <class Sweep>
bool NewtonMethod<Sweep>::MayMove() const {
  return current_.residual <= std::max(settings_.part_tolerance, settings_.tolerance) ||
         iterations_since_move_ >= settings_.most_iterations_a_part;
}

template <class Sweep>
int NewtonMethod<Sweep>::Move(const InstrumentPlaces& goal, WireState& state) {
  const InstrumentPlaces here = state.places();
  const double feed_mm = std::min(settings_.max_feed_mm, model_.segment_mm() / 2);
  const InstrumentPlaces next = stack().Towards(goal, here, feed_mm, settings_.max_turn_rad);
  // For the terms each part is a tick, so their memory does not depend on the length of a tick.
  if (part_moved_) {
    EndPart();
    BeginPart(state);
  }
  part_moved_ = true;
  if (!terms_.empty()) {
    const double share = ShareOfWay(here, next, goal, feed_mm, settings_.max_turn_rad);
    for (EnergyTerm* term : terms_) term->TakeShare(share);
  }
  active_set_.RememberPressed(current_);
  MoveTo(next, state);

  // An empty state keeps no twist. Without these memories too, a restart repeats the same motion.
  if (state.segments() == 0) {
    damping_.ForgetMoves();
    prediction_.Forget();
  }
  damping_.Move();
  attempting_ = stable_ = stalled_ = pushed_ = false;
  moved_ = true;
  iterations_since_move_ = 0;
  mechanics_.points().TakeStiffness(state);
  mechanics_.Expand(state, current_);
  up_to_date_ = true;

  int actions = 0;
  for (int k = 0; k < here.size(); ++k) {
    actions += (next[k].insertion_mm != here[k].insertion_mm) +
               (next[k].rotation_rad != here[k].rotation_rad);
  }
  return actions;
}

template <class Sweep>
void NewtonMethod<Sweep>::MoveTo(const InstrumentPlaces& next, WireState& state) {
  const bool alone = next.size() == 1;
  MoveSurfaces(state.places(), next);
  if (kFront && two_curves_) {
    MoveBothTo(next, state);
    return;
  }
  if (!alone) {
    stack().Combine(next);
    mechanics_.points().TakeRadii();
    state.MoveInstruments(model_, next);
  }
  prediction_.Feed(model_, next.reach_mm(), state);
  if (alone) state.Rotate(next[0].rotation_rad);
}

// If the other curve is about to lead, both have the same reach before or after the move (Towards).
template <class Sweep>
void NewtonMethod<Sweep>::MoveBothTo(const InstrumentPlaces& next, WireState& state) {
  const WireModel& second = *stack().second_rod();
  const auto exchange_when_equal = [&] {
    if (stack().OuterLeads(next) == state.outer_leads()) return;
    if (state.segments() != state.second()->segments()) return;
    state.ExchangeCurves();
    prediction_.Forget();
  };
  const double fed_mm = next.reach_mm() - state.insertion_mm();
  const int segments = state.segments();
  const bool equal = stack().SecondReach(state.places()) == state.insertion_mm();
  if (equal) exchange_when_equal();
  state.MoveBoth(model_, second, next);
  prediction_.Feed(model_, next.reach_mm(), state);
  double reach_mm = 0;  // reach of the present second curve
  for (int k = 0; k < next.size(); ++k) {
    if (&state.CurveOf(k) == state.second()) reach_mm = std::max(reach_mm, next[k].insertion_mm);
  }
  state.FeedSecond(second, segments, fed_mm, reach_mm);
  if (!equal) exchange_when_equal();
  stack().Combine(next, ShortBy(state));
  mechanics_.points().TakeRadii();
  state.UpdateCurves(model_, second);
}

// Inside another instrument, the outer instrument's surface touches the wall and follows its own
// hand. A wire that twists moves its surface along with its normals.
template <class Sweep>
void NewtonMethod<Sweep>::MoveSurfaces(const InstrumentPlaces& here, const InstrumentPlaces& next) {
  if (kTwists) return;
  const double fed_mm = next.reach_mm() - here.reach_mm();
  std::array<SurfaceMove, kMostInstruments> moves = {};
  bool any = false;
  for (int k = 0; k < here.size(); ++k) {
    SurfaceMove& move = moves[static_cast<std::size_t>(k)];
    move.along_mm = next[k].insertion_mm - here[k].insertion_mm - fed_mm;
    if (!kFront || model_.spins() == 0) move.turn_rad = next[k].rotation_rad - here[k].rotation_rad;
    any = any || move.along_mm != 0 || move.turn_rad != 0;
  }
  if (!any) return;
  for (EnergyTerm* term : terms_) term->MoveSurfaces(current_.points, moves);
}

template <class Sweep>
bool NewtonMethod<Sweep>::AtRest(WireState& state) {
  if (stalled_) return true;
  if (attempting_) return false;  // current_ then holds the loads of the model
  BringUpToDate(state);
  if (state.segments() == 0) return true;
  if (current_.residual > settings_.tolerance) return false;
  // A finite solver error implies that the step has a minimum, so the equilibrium is stable.
  if (settings_.tolerance_mm > 0 && SolverErrorMm(state) > settings_.tolerance_mm) return false;
  if (Stable(state)) return true;
  if (!pushed_) PushOff(state);
  pushed_ = true;
  return false;
}

template <class Sweep>
void NewtonMethod<Sweep>::Relax(WireState& state, TickReport& report) {
  BringUpToDate(state);
  if (!attempting_) damping_.Begin(current_.residual);
  attempting_ = true;
  AttemptRecord record;
  record.residual = current_.residual;
  record.energy_mJ = current_.energy_mJ;
  record.weight = damping_.weight();
  record.lookups = -mechanics_.points().lookups();

  const Solution model = SolveModel(state);
  record.active_set_rounds = model.rounds;
  if (model.expected_mJ >= 0) {
    const double scale = StepScale();
    StepTrial(state, scale);
    mechanics_.Expand(trial_, trial_expansion_);
    report.updates += state.segments();
    record.step_scale = scale;
    record.expected_mJ = model.expected_mJ;
    record.gained_mJ = current_.energy_mJ - trial_expansion_.energy_mJ;
    // Near the minimum the gain is below the rounding error of the energy; then the residual
    // decides.
    const double rounding = 1e-12 * std::abs(current_.energy_mJ);
    record.accepted =
        record.gained_mJ >= 0.1 * scale * model.expected_mJ ||
        (record.gained_mJ >= -rounding && trial_expansion_.residual < current_.residual);
  }
  const double residual = current_.residual;
  if (record.accepted) {
    state.TakeStep(trial_);
    std::swap(current_, trial_expansion_);
  }
  record.lookups += mechanics_.points().lookups();
  if (records() != nullptr) records()->push_back(record);

  if (record.accepted) {
    stable_ = damping_.weight() == 0;
    const bool well = record.step_scale == 1 && record.gained_mJ >= 0.5 * model.expected_mJ;
    damping_.Accept(residual, well, moved_);
    moved_ = attempting_ = false;
    ++iterations_since_move_;
    ++report.iterations;
  } else if (!damping_.Raise(current_.residual)) {
    GiveUp(state);
    ++report.iterations;
  }
}

template <class Sweep>
void NewtonMethod<Sweep>::StepTrial(const WireState& state, double scale) {
  trial_.Step(model_, state, current_.frames, step_, spin_step_, scale);
  if constexpr (kFront) {
    if (!two_curves_) return;
    trial_.StepSecond(*stack().second_rod(), state, current_.second.front().frames,
                      sweep_.second_step(), sweep_.second_spin(), scale);
  }
}

template <class Sweep>
double NewtonMethod<Sweep>::StepScale() const {
  double longest = 0;
  if constexpr (kFront) {
    for (const Vector2d& xi : sweep_.second_step()) longest = std::max(longest, xi.squaredNorm());
    for (const double zeta : sweep_.second_spin()) longest = std::max(longest, zeta * zeta);
  }
  for (const Vector2d& xi : step_) longest = std::max(longest, xi.squaredNorm());
  for (const double zeta : spin_step_) longest = std::max(longest, zeta * zeta);
  longest = std::sqrt(longest);
  return longest > settings_.max_step_rad ? settings_.max_step_rad / longest : 1;
}

// Sums the loads of the model with the springs of the active sets.
template <class Sweep>
void NewtonMethod<Sweep>::ModelLoads(const WireState& state) {
  mechanics_.Model(state, active_set_.active(), current_);
  if (kFront && two_curves_) WireMechanics::ModelBetween(between_set_.active(), current_);
}

template <class Sweep>
void NewtonMethod<Sweep>::BeginModel(const WireState& state, bool moved) {
  active_set_.Begin(current_, moved);
  if (kFront && two_curves_) between_set_.Begin(current_.between);
  ModelLoads(state);
}

// Updates the sets for the step; returns the most distal segment with a change, or -1.
template <class Sweep>
int NewtonMethod<Sweep>::UpdateModel(const WireState& state) {
  const CurveStep step{step_, displacement_mm_};
  if constexpr (kFront) {
    if (two_curves_) {
      const CurveStep second{sweep_.second_step(), sweep_.second_displacement_mm()};
      const int last = active_set_.Update(state, current_, step, second);
      return std::max(last, between_set_.Update(state, current_, step, second));
    }
  }
  return active_set_.Update(state, current_, step);
}

template <class Sweep>
double NewtonMethod<Sweep>::EnergyAtRest() const {
  double sum = active_set_.EnergyAtRest(current_);
  if (kFront && two_curves_) sum += between_set_.EnergyAtRest(current_.between);
  return sum;
}

// Minimizes the model, in which every near point has a one-sided spring. This is Newton's method on
// a piecewise quadratic function.
template <class Sweep>
typename NewtonMethod<Sweep>::Solution NewtonMethod<Sweep>::SolveModel(const WireState& state) {
  constexpr int kRounds = 6;
  BeginModel(state, moved_);
  int last_changed = state.segments() - 1;
  for (int round = 1;; ++round) {
    if (!sweep_.Refactor(model_, state, current_, damping_.weight(), last_changed)) {
      return {.rounds = round};
    }
    const double decrease =
        sweep_.Step(model_, state, current_, step_, spin_step_, displacement_mm_);
    if (!std::isfinite(decrease)) return {.rounds = round};
    const double at_rest = EnergyAtRest();
    last_changed = UpdateModel(state);
    if (last_changed < 0 || round == kRounds) {
      return {.expected_mJ = decrease - at_rest, .rounds = round};
    }
    ModelLoads(state);
  }
}

template <class Sweep>
void NewtonMethod<Sweep>::GiveUp(WireState& state) {
  mechanics_.Expand(state, current_);
  damping_.Forget();
  stalled_ = true;
  attempting_ = false;
}

// True if a state in equilibrium is a minimum: a straight wire pushed head-on is in equilibrium
// too.
template <class Sweep>
bool NewtonMethod<Sweep>::Stable(const WireState& state) {
  if (!stable_) stable_ = sweep_.Factor(model_, state, current_, kStableWeight);
  return stable_;
}

template <class Sweep>
void NewtonMethod<Sweep>::PushOff(WireState& state) {
  // A pseudo-random push excites every shape; its direction is arbitrary, but always the same.
  step_.resize(state.tangents().size());
  std::uint32_t random = 1;
  for (Vector2d& xi : step_) {
    for (double& component : xi) {
      random = 1664525 * random + 1013904223;
      component = kPush * (random / 2147483648.0 - 1);
    }
  }
  spin_step_.assign(step_.size() * static_cast<std::size_t>(model_.spins()), 0);
  trial_.Step(model_, state, current_.frames, step_, spin_step_, 1);
  if (kFront && two_curves_) {
    // Both curves get the same push, because the inner instruments move along in the lumen.
    second_push_.assign(step_.begin(), step_.begin() + state.second()->segments());
    const auto spins = static_cast<std::size_t>(stack().second_rod()->spins());
    second_push_spin_.assign(second_push_.size() * spins, 0);
    trial_.StepSecond(*stack().second_rod(), state, current_.second.front().frames, second_push_,
                      second_push_spin_, 1);
  }
  state.TakeStep(trial_);
  moved_ = attempting_ = false;
  mechanics_.Expand(state, current_);
}

template <class Sweep>
void NewtonMethod<Sweep>::End(const WireState& /*state*/, bool settled, TickReport& report) {
  if (settled) EndPart();
  report.converged = up_to_date_ && current_.residual <= settings_.tolerance;
  report.stalled = stalled_;
  report.energy_mJ = current_.energy_mJ - current_.dissipated_mJ;
  report.dissipated_mJ = current_.dissipated_mJ;
  report.residual = current_.residual;
  report.max_penetration_mm = current_.max_penetration_mm;
}

template class NewtonMethod<RiccatiSweep<BendStage>>;
template class NewtonMethod<RiccatiSweep<TwistStage>>;
template class NewtonMethod<FrontSweep>;

namespace {

template <class Wires>
std::unique_ptr<Relaxation> MakeLone(Wires& wires, bool twists, const ClearanceField& field,
                                     const WallModel& wall, const NewtonSettings& settings,
                                     const std::vector<EnergyTerm*>& terms) {
  if (twists) {
    return std::make_unique<NewtonMethod<RiccatiSweep<TwistStage>>>(wires, field, wall, settings,
                                                                    terms);
  }
  return std::make_unique<NewtonRelaxation>(wires, field, wall, settings, terms);
}

}  // namespace

std::unique_ptr<Relaxation> MakeNewtonRelaxation(const WireModel& wire, const ClearanceField& field,
                                                 const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms) {
  return MakeLone(wire, wire.twists(), field, wall, settings, terms);
}

std::unique_ptr<Relaxation> MakeNewtonRelaxation(InstrumentStack& stack,
                                                 const ClearanceField& field, const WallModel& wall,
                                                 const NewtonSettings& settings,
                                                 const std::vector<EnergyTerm*>& terms) {
  if (stack.second_rod() != nullptr || stack.rod().stack_twists()) {
    return std::make_unique<NewtonMethod<FrontSweep>>(stack, field, wall, settings, terms);
  }
  return MakeLone(stack, stack.rod().twists(), field, wall, settings, terms);
}

}  // namespace torquer
