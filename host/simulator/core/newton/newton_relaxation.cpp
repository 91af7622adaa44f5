#include "host/simulator/core/newton/newton_relaxation.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "host/simulator/core/hash.h"
#include "host/simulator/core/newton/linearized_balance.h"
#include "host/simulator/core/newton/move_instruments.h"

namespace torquer {

using Part = NewtonMemory::Part;
using Phase = NewtonMemory::Phase;

namespace {

// Feed that segments of any length allow. The path of friction depends on the length of a part and
// not on that of a segment.
constexpr double kFeedOfShortSegmentsMm = 0.25;

}  // namespace

template <class Sweep>
NewtonMethod<Sweep>::NewtonMethod(const WireModel& wire, const ClearanceField& field,
                                  const WallModel& wall, const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : NewtonMethod(std::in_place, wire, field, wall, settings, terms) {}

template <class Sweep>
NewtonMethod<Sweep>::NewtonMethod(const InstrumentStack& stack, const ClearanceField& field,
                                  const WallModel& wall, const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : NewtonMethod(std::in_place, stack, field, wall, settings, terms) {}

template <class Sweep>
template <class Wires>
NewtonMethod<Sweep>::NewtonMethod(std::in_place_t /*both*/, const Wires& wires,
                                  const ClearanceField& field, const WallModel& wall,
                                  const NewtonSettings& settings,
                                  const std::vector<EnergyTerm*>& terms)
    : Relaxation(wires),
      model_(rods()[0]),
      field_(field),
      settings_(settings),
      terms_(terms),
      mechanics_(rods(), field, wall, terms),
      solver_(mechanics_),
      memory_{.current = mechanics_.MakeQuadraticModel()},
      trial_quadratic_(mechanics_.MakeQuadraticModel()),
      trial_(model_, stack().size()) {
  assert(kFront == (mechanics_.has_pairs() || model_.stack_twists()));
  assert(kFront || kTwists == model_.twists());
  memory_.Reserve(mechanics_);
  trial_.RemoveOthers(stack().curves());
  for (int c = 1; c < stack().curves(); ++c) {
    trial_.AddCurve(rods()[c], stack().size(), stack().OnCurve(c).first);
  }
  if (!kTwists && !kFront) defect_.Reserve(model_.max_segments());
  if (kFront && model_.spins() > 0 && !terms.empty()) {
    balance_.Reserve(model_.max_segments(), wall.points_per_segment);
  }
}

template <class Sweep>
void NewtonMethod<Sweep>::Restart(WireState& state) {
  Combine(state.poses());
  if (state.curves() != stack().curves()) LayCurves(rods(), state);
  for (int c = 0; c < state.curves(); ++c) {
    ContactPoints& points = mechanics_.points(c);
    points.Forget();
    points.SampleStiffness(state.curve(c));
  }
  for (EnergyTerm* term : terms_) term->Reset();
  memory_.Forget();
  memory_.travel_mm = field_.TravelMm();
  Pair(state);
  if (follower() != nullptr) follower()->Restart(state);
}

template <class Sweep>
void NewtonMethod<Sweep>::CopyFrom(const Relaxation& twin, const WireState& state) {
  const auto& from = dynamic_cast<const NewtonMethod&>(twin);
  Combine(state.poses());
  mechanics_.CopyFrom(from.mechanics_);
  memory_ = from.memory_;
}

template <class Sweep>
std::uint64_t NewtonMethod<Sweep>::Hash(std::uint64_t seed) const {
  for (const EnergyTerm* term : terms_) seed = term->Hash(seed);
  return memory_.Hash(mechanics_.Hash(seed));
}

template <class Sweep>
void NewtonMethod<Sweep>::BuildModel(const WireState& state) {
  mechanics_.BuildModel(state, memory_.current);
  memory_.up_to_date = true;
}

template <class Sweep>
void NewtonMethod<Sweep>::BringUpToDate(const WireState& state) {
  if (memory_.up_to_date) return;
  // A part without motion begins with the pairs of its state; a move finds them itself.
  if (memory_.part == Part::kOpen) {
    Pair(state);
    memory_.pairings = 0;
  } else {
    BuildModel(state);
  }
}

// Finds the pairs of the curves at a state, and its quadratic model.
template <class Sweep>
void NewtonMethod<Sweep>::Pair(const WireState& state) {
  mechanics_.PairCurves(state);
  BuildModel(state);
  memory_.paired = true;
  memory_.residual_when_paired = memory_.current.residual;
  memory_.moved_since_paired_mm = 0;
}

template <class Sweep>
void NewtonMethod<Sweep>::RestoreTrueLoads(const WireState& state) {
  BringUpToDate(state);
  if (!memory_.attempting()) return;
  // Restores the loads of the state, which those of the model had replaced.
  solver_.Begin(state, false, memory_.active_sets, memory_.current);
}

template <class Sweep>
double NewtonMethod<Sweep>::SolverErrorMm(const WireState& state) {
  if (state.Farthest().segments() == 0) return 0;
  RestoreTrueLoads(state);
  if (!mechanics_.has_pairs() || memory_.paired) return solver_.NextStepMm(state, memory_.current);
  // The next step with the pairs of this state. The solver keeps its own.
  mechanics_.ExchangePairs();
  mechanics_.PairCurves(state);
  mechanics_.BuildModel(state, trial_quadratic_);
  mechanics_.ExchangePairs();
  return solver_.NextStepMm(state, trial_quadratic_);
}

template <class Sweep>
double NewtonMethod<Sweep>::DiscretizationErrorMm(const WireState& state) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  // Terms with memory depend on the path, not on the position alone.
  const bool remembers = std::any_of(terms_.begin(), terms_.end(),
                                     [](const EnergyTerm* term) { return term->Dissipates(); });
  if (kTwists || kFront || remembers) return kUnknown;
  if (state.Farthest().segments() == 0) return 0;
  RestoreTrueLoads(state);
  // The set of touching points and the indentation by a tip are not smooth functions of the mesh.
  if (memory_.current.max_penetration_mm > 0) return kUnknown;
  trial_quadratic_ = memory_.current;
  defect_.ReplaceGradients(model_, state, trial_quadratic_);
  return solver_.NextStepMm(state, trial_quadratic_, &defect_.shift_mm());
}

template <class Sweep>
bool NewtonMethod<Sweep>::Arrived(const InstrumentPoses& goal, const WireState& state) const {
  return state.poses() == goal;
}

template <class Sweep>
void NewtonMethod<Sweep>::Begin(WireState& state) {
  // Continues an interrupted part, unless the vessel has moved since.
  const bool still = field_.TravelMm() == memory_.travel_mm;
  const bool begins = memory_.part == Part::kClosed;
  if (begins || !still) {
    BeginPart(state);
    if (memory_.stalled()) memory_.phase = Phase::kIdle;
    memory_.pushed = false;
  }
  memory_.up_to_date = memory_.up_to_date && still;
  if (begins && !still) {
    FollowVessel(state);
  } else {
    memory_.ForgetTravels();
  }
  memory_.travel_mm = field_.TravelMm();
}

// Moves the curves as the vessel's motion will, by the prediction.
template <class Sweep>
void NewtonMethod<Sweep>::FollowVessel(WireState& state) {
  const double travel_mm = field_.LastTravelMm();
  const double most_mm = FindPassingLimits(state, mechanics_, memory_.current.between).predicted_mm;
  for (int c = 0; c < state.curves(); ++c) {
    memory_.feeds[c].Finish(state.curve(c));
    memory_.travels[c].Travel(mechanics_.model(c), travel_mm, most_mm, state.curve(c));
  }
}

// Contact forces are undefined until the solver has converged, so none are given.
template <class Sweep>
void NewtonMethod<Sweep>::FindPressed(const WireState& state) {
  const auto between = std::find_if(terms_.begin(), terms_.end(), [](EnergyTerm* term) {
    return term->between_term() != nullptr;
  });
  if (between == terms_.end()) return;
  QuadraticModel& at = memory_.current;
  for (int c = 0; c < state.curves(); ++c) at.curve(c).points.between.pressed_N.clear();
  if (at.residual > std::max(settings_.part_tolerance, settings_.tolerance)) return;
  balance_.FindPressed(rods(), state, (*between)->between_term()->sliding(), at);
}

template <class Sweep>
void NewtonMethod<Sweep>::BeginPart(const WireState& state) {
  if (kFront && model_.spins() > 0 && stack().size() > 1) FindPressed(state);
  for (EnergyTerm* term : terms_) {
    for (int c = 0; c < state.curves(); ++c) term->Begin(memory_.current.curve(c).points);
  }
  if (follower() != nullptr) follower()->BeginPart();
  memory_.part = Part::kOpen;
  // Begin of the terms, or other pairs of the curves, may change the energy.
  memory_.up_to_date = memory_.up_to_date && terms_.empty() && !mechanics_.has_pairs();
}

template <class Sweep>
void NewtonMethod<Sweep>::EndPart(const WireState& state) {
  if (follower() != nullptr) {
    SweepBalance<Sweep> balance(mechanics_, solver_, trial_quadratic_);
    follower()->EndPart(state, balance);
  }
  for (EnergyTerm* term : terms_) {
    for (int c = 0; c < mechanics_.curves(); ++c) term->End(memory_.current.curve(c).points);
  }
  memory_.part = Part::kClosed;
}

// A wire that the budget left moved but not relaxed is relaxed before the next move.
template <class Sweep>
bool NewtonMethod<Sweep>::MayMove() const {
  // The residual hardly shows long waves, which damped steps leave and predictions would repeat.
  const double share = memory_.stable ? 1 : memory_.moved ? 0.3 : 0.1;
  const double tolerance = share * settings_.part_tolerance;
  return memory_.current.residual <= std::max(tolerance, settings_.tolerance) ||
         memory_.iterations_since_move >= settings_.most_iterations_a_part;
}

template <class Sweep>
int NewtonMethod<Sweep>::Move(const InstrumentPoses& goal, WireState& state) {
  const InstrumentPoses here = state.poses();
  const PassingLimits limits = FindPassingLimits(state, mechanics_, memory_.current.between);
  const double limit_mm = std::max(kFeedOfShortSegmentsMm, model_.segment_mm() / 2);
  const double feed_mm = std::min({settings_.max_feed_mm, limit_mm, limits.feed_mm});
  const InstrumentPoses next = NextPoses(stack(), here, goal, feed_mm, settings_.max_turn_rad);
  // For the terms each part is a tick, so their memory does not depend on the length of a tick.
  if (memory_.part == Part::kMoved) {
    EndPart(state);
    BeginPart(state);
  }
  memory_.part = Part::kMoved;
  const bool has_parts = !terms_.empty() || follower() != nullptr;
  const double fraction =
      has_parts ? FractionOfMotion(here, next, goal, feed_mm, settings_.max_turn_rad) : 1;
  if (!terms_.empty()) {
    for (EnergyTerm* term : terms_) {
      if (TimedTerm* timed = term->timed_term()) timed->SetMotionFraction(fraction);
    }
    MoveSurfaces(stack(), here, next, model_.spins() == 0, memory_.current, terms_);
  }
  for (int c = 0; c < state.curves(); ++c) {
    memory_.active_sets[c].RememberPressed(memory_.current.curve(c));
  }
  Combine(next);
  MoveInstruments(next, limits.predicted_mm, rods(), memory_.feeds, state);

  // An empty state keeps no twist. Without these memories too, a restart repeats the same motion.
  if (state.Farthest().segments() == 0) {
    memory_.damping.ForgetMoves();
    memory_.ForgetPredictions();
  }
  memory_.ForgetTravels();
  memory_.Move();
  for (int c = 0; c < state.curves(); ++c) mechanics_.points(c).SampleStiffness(state.curve(c));
  if (follower() != nullptr) follower()->MovePart({here, next, fraction}, state);
  Pair(state);
  return CountActions(here, next);
}

template <class Sweep>
bool NewtonMethod<Sweep>::AtRest(WireState& state) {
  if (memory_.stalled()) return true;
  if (memory_.attempting()) return false;  // memory_.current then holds the loads of the model
  BringUpToDate(state);
  if (state.Farthest().segments() == 0) return true;
  // Near rest, a step with old pairs gains less than pairing the curves again. Before this point
  // the curves still change, and the pairs would keep the bulges of an old shape.
  constexpr double kNearRest = 3e-5;
  if (memory_.current.residual > std::max(kNearRest, settings_.tolerance)) return false;
  if (!Paired(state)) return false;
  if (memory_.current.residual > settings_.tolerance) return false;
  // A finite solver error implies that the step has a minimum, so the equilibrium is stable.
  if (settings_.tolerance_mm > 0 && SolverErrorMm(state) > settings_.tolerance_mm) return false;
  if (Stable(state)) return true;
  if (!memory_.pushed) PushOff(state);
  memory_.pushed = true;
  return false;
}

// True if the curves are in equilibrium with the pairs of this state. Otherwise pairs them and goes
// on, a few times.
template <class Sweep>
bool NewtonMethod<Sweep>::Paired(const WireState& state) {
  constexpr int kMostPairings = 4;
  // Pairing again leaves less than this part of the residual that was removed since the last one.
  constexpr double kMostLeft = 0.03;
  if (!mechanics_.has_pairs() || memory_.paired || memory_.pairings == kMostPairings) return true;
  if (kMostLeft * memory_.residual_when_paired <= settings_.tolerance) return true;
  Pair(state);
  ++memory_.pairings;
  return memory_.current.residual <= settings_.tolerance;
}

template <class Sweep>
void NewtonMethod<Sweep>::Relax(WireState& state, TickReport& report) {
  BringUpToDate(state);
  if (!memory_.attempting()) memory_.damping.Begin(memory_.current.residual);
  memory_.phase = Phase::kAttempting;
  const AttemptRecord record = Attempt(state, report);
  if (records() != nullptr) records()->push_back(record);
  if (record.accepted) {
    Accept(record, state, report);
  } else if (!memory_.damping.Raise(memory_.current.residual)) {
    GiveUp(state);
    ++report.iterations;
  }
}

// Solves the model and evaluates its step in trial_. Accepts a step that gains enough energy.
template <class Sweep>
AttemptRecord NewtonMethod<Sweep>::Attempt(const WireState& state, TickReport& report) {
  QuadraticModel& current = memory_.current;
  AttemptRecord record;
  record.residual = current.residual;
  record.energy_mJ = current.energy_mJ;
  record.weight = memory_.damping.weight();
  record.lookups = -mechanics_.lookups();

  const auto solution =
      solver_.Solve(state, record.weight, memory_.moved, memory_.active_sets, current);
  record.active_set_rounds = solution.rounds;
  record.definite = solution.definite;
  if (solution.expected_mJ >= 0) {
    const double turn = solver_.LargestTurn();
    const double turning = turn > settings_.max_step_rad ? settings_.max_step_rad / turn : 1;
    const double scale = std::min(turning, solver_.PassingScale(state, current));
    solver_.Apply(state, current, scale, trial_);
    mechanics_.BuildModel(trial_, trial_quadratic_);
    for (int c = 0; c < state.curves(); ++c) report.updates += state.curve(c).segments();
    record.step_scale = scale;
    record.expected_mJ = solution.expected_mJ;
    record.gained_mJ = current.energy_mJ - trial_quadratic_.energy_mJ;
    // Near the minimum the gain is below the rounding error of the energy; then the residual
    // decides.
    const double rounding = 1e-12 * std::abs(current.energy_mJ);
    record.accepted =
        record.gained_mJ >= 0.1 * scale * solution.expected_mJ ||
        (record.gained_mJ >= -rounding && trial_quadratic_.residual < current.residual);
  }
  record.lookups += mechanics_.lookups();
  return record;
}

template <class Sweep>
void NewtonMethod<Sweep>::Accept(const AttemptRecord& record, WireState& state,
                                 TickReport& report) {
  if (mechanics_.has_beside()) {
    memory_.moved_since_paired_mm +=
        record.step_scale * solver_.LongestMoveMm(state, memory_.current);
  }
  state.TakeStep(trial_);
  std::swap(memory_.current, trial_quadratic_);
  memory_.stable = memory_.damping.weight() == 0 && record.definite;
  const bool well = record.step_scale == 1 && record.gained_mJ >= 0.5 * record.expected_mJ;
  memory_.damping.Accept(record.residual, well, memory_.moved);
  memory_.moved = memory_.paired = false;
  memory_.phase = Phase::kIdle;
  ++memory_.iterations_since_move;
  ++report.iterations;
  PairAfterLongMoves(state);
}

// Curves beside each other are kept apart only where they are paired. After a move by half a piece
// they face other places.
template <class Sweep>
void NewtonMethod<Sweep>::PairAfterLongMoves(const WireState& state) {
  const int pieces = LumenPairs::PiecesPerSegment(mechanics_.wall().points_per_segment);
  if (memory_.moved_since_paired_mm > model_.segment_mm() / (2 * pieces)) Pair(state);
}

template <class Sweep>
void NewtonMethod<Sweep>::GiveUp(const WireState& state) {
  BuildModel(state);
  memory_.damping.Forget();
  memory_.phase = Phase::kStalled;
}

// True if a state in equilibrium is a minimum. A straight wire pushed head-on may be none.
template <class Sweep>
bool NewtonMethod<Sweep>::Stable(const WireState& state) {
  constexpr double kStableWeight = 1e-6;  // an equilibrium that is stable with it counts as stable
  if (!memory_.stable) memory_.stable = solver_.IsDefinite(state, memory_.current, kStableWeight);
  return memory_.stable;
}

template <class Sweep>
void NewtonMethod<Sweep>::PushOff(WireState& state) {
  solver_.Push(state, memory_.current, trial_);
  state.TakeStep(trial_);
  memory_.moved = memory_.paired = false;
  memory_.residual_when_paired = std::numeric_limits<double>::infinity();
  memory_.phase = Phase::kIdle;
  BuildModel(state);
}

template <class Sweep>
void NewtonMethod<Sweep>::End(const WireState& state, bool settled, TickReport& report) {
  if (settled) EndPart(state);
  const QuadraticModel& current = memory_.current;
  report.converged = memory_.up_to_date && current.residual <= settings_.tolerance;
  report.stalled = memory_.stalled();
  report.dissipated_mJ = current.dissipated_mJ;
  report.residual = current.residual;
  report.max_penetration_mm = current.max_penetration_mm;
}

template class NewtonMethod<RiccatiSweep<BendStage>>;
template class NewtonMethod<RiccatiSweep<TwistStage>>;
template class NewtonMethod<FrontSweep>;

}  // namespace torquer
