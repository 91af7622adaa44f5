#include "host/simulator/core/newton/step_solver.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "host/simulator/core/instrument_place.h"

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

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
Sweep StepSolver<Sweep>::MakeSweep(int max_segments, const WireModel* second) {
  if constexpr (kFront) {
    return FrontSweep(max_segments, second);
  } else {
    static_cast<void>(second);
    return Sweep(max_segments);
  }
}

template <class Sweep>
StepSolver<Sweep>::StepSolver(const WireMechanics& mechanics, const WireModel* second)
    : mechanics_(mechanics),
      model_(mechanics.model()),
      second_(second),
      sweep_(MakeSweep(model_.max_segments(), second)),
      between_set_(second == nullptr ? 0 : mechanics.points().capacity() + 1) {
  const auto room = static_cast<std::size_t>(model_.max_segments()) + 1;
  step_.reserve(room);
  displacement_mm_.reserve(room);
  // Two curves may exchange roles, and then the numbers of their spins.
  spin_step_.reserve(room * (kFront ? kMostInstruments : model_.spins()));
  if (two_curves()) {
    second_push_.reserve(room);
    second_push_spin_.reserve(room * kMostInstruments);
  }
}

// Sums the loads of the model with the springs of the active sets.
template <class Sweep>
void StepSolver<Sweep>::TakeLoads(const WireState& state, const ActiveSet& wall_set,
                                  Expansion& at) const {
  mechanics_.Model(state, wall_set.active(), at);
  if (two_curves()) WireMechanics::ModelBetween(between_set_.active(), at);
}

template <class Sweep>
void StepSolver<Sweep>::Begin(const WireState& state, bool moved, ActiveSet& wall_set,
                              Expansion& at) {
  wall_set.Begin(at, moved);
  if (two_curves()) between_set_.Begin(at.between);
  TakeLoads(state, wall_set, at);
}

// Updates the sets for the step; returns the most distal segment with a change, or -1.
template <class Sweep>
int StepSolver<Sweep>::UpdateSets(const WireState& state, const Expansion& at,
                                  ActiveSet& wall_set) {
  const CurveStep step{step_, displacement_mm_};
  if constexpr (kFront) {
    if (second_ != nullptr) {
      const CurveStep second{sweep_.second_step(), sweep_.second_displacement_mm()};
      const int last = wall_set.Update(state, at, step, second);
      return std::max(last, between_set_.Update(state, at, step, second));
    }
  }
  return wall_set.Update(state, at, step);
}

template <class Sweep>
typename StepSolver<Sweep>::Solution StepSolver<Sweep>::Solve(const WireState& state, double weight,
                                                              bool moved, ActiveSet& wall_set,
                                                              Expansion& at) {
  constexpr int kRounds = 6;
  Begin(state, moved, wall_set, at);
  int last_changed = state.segments() - 1;
  for (int round = 1;; ++round) {
    if (!sweep_.Refactor(model_, state, at, weight, last_changed)) return {.rounds = round};
    const double decrease = sweep_.Step(model_, state, at, step_, spin_step_, displacement_mm_);
    if (!std::isfinite(decrease)) return {.rounds = round};
    double at_rest = wall_set.EnergyAtRest(at);
    if (two_curves()) at_rest += between_set_.EnergyAtRest(at.between);
    last_changed = UpdateSets(state, at, wall_set);
    if (last_changed < 0 || round == kRounds) {
      return {.expected_mJ = decrease - at_rest, .rounds = round};
    }
    TakeLoads(state, wall_set, at);
  }
}

template <class Sweep>
void StepSolver<Sweep>::Apply(const WireState& state, const Expansion& at, double scale,
                              WireState& trial) const {
  trial.Step(model_, state, at.frames, step_, spin_step_, scale);
  if constexpr (kFront) {
    if (second_ == nullptr) return;
    trial.StepSecond(*second_, state, at.second.front().frames, sweep_.second_step(),
                     sweep_.second_spin(), scale);
  }
}

template <class Sweep>
double StepSolver<Sweep>::LargestTurn() const {
  double squared = 0;
  if constexpr (kFront) {
    for (const Vector2d& xi : sweep_.second_step()) squared = std::max(squared, xi.squaredNorm());
    for (const double zeta : sweep_.second_spin()) squared = std::max(squared, zeta * zeta);
  }
  for (const Vector2d& xi : step_) squared = std::max(squared, xi.squaredNorm());
  for (const double zeta : spin_step_) squared = std::max(squared, zeta * zeta);
  return std::sqrt(squared);
}

template <class Sweep>
bool StepSolver<Sweep>::IsDefinite(const WireState& state, const Expansion& at, double weight) {
  return sweep_.Factor(model_, state, at, weight);
}

template <class Sweep>
double StepSolver<Sweep>::NextStepMm(const WireState& state, const Expansion& at,
                                     const std::vector<Vector3d>* shift_mm) {
  if (!IsDefinite(state, at, 0)) return std::numeric_limits<double>::quiet_NaN();
  sweep_.Step(model_, state, at, step_, spin_step_, displacement_mm_);
  double longest_mm = LongestMm(model_, state, at, {step_, displacement_mm_}, shift_mm);
  if constexpr (kFront) {
    if (second_ != nullptr) {
      longest_mm =
          std::max(longest_mm, LongestMm(*second_, *state.second(), at.second.front(),
                                         {sweep_.second_step(), sweep_.second_displacement_mm()}));
    }
  }
  return longest_mm;
}

template <class Sweep>
void StepSolver<Sweep>::Push(const WireState& state, const Expansion& at, WireState& trial) {
  constexpr double kPush = 1e-4;  // largest turn of a segment, rad
  step_.resize(state.tangents().size());
  std::uint32_t random = 1;
  for (Vector2d& xi : step_) {
    for (double& component : xi) {
      random = 1664525 * random + 1013904223;
      component = kPush * (random / 2147483648.0 - 1);
    }
  }
  spin_step_.assign(step_.size() * static_cast<std::size_t>(model_.spins()), 0);
  trial.Step(model_, state, at.frames, step_, spin_step_, 1);
  if (!two_curves()) return;
  // Both curves get the same push, because the inner instruments move along in the lumen.
  second_push_.assign(step_.begin(), step_.begin() + state.second()->segments());
  const auto spins = static_cast<std::size_t>(second_->spins());
  second_push_spin_.assign(second_push_.size() * spins, 0);
  trial.StepSecond(*second_, state, at.second.front().frames, second_push_, second_push_spin_, 1);
}

template class StepSolver<RiccatiSweep<BendStage>>;
template class StepSolver<RiccatiSweep<TwistStage>>;
template class StepSolver<FrontSweep>;

}  // namespace torquer
