#include "host/simulator/core/newton/step_solver.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

constexpr double kNotFound = std::numeric_limits<double>::quiet_NaN();

// Largest displacement of a node by a step, plus its `shift_mm` if given.
double LongestMm(const WireModel& model, const Curve& curve, const CurveQuadraticModel& at,
                 const CurveStep& step, const std::vector<Vector3d>* shift_mm = nullptr) {
  const int n = curve.segments();
  if (n == 0) return 0;
  double squared = 0;
  for (int i = 0; i <= n; ++i) {
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
Sweep StepSolver<Sweep>::MakeSweep(const WireMechanics& mechanics) {
  if constexpr (kFront) {
    std::vector<const WireModel*> rods;
    for (int c = 0; c < mechanics.curves(); ++c) rods.push_back(&mechanics.model(c));
    return FrontSweep(std::move(rods), mechanics.MakeQuadraticModel().between);
  } else {
    return Sweep(mechanics.model().max_segments());
  }
}

template <class Sweep>
StepSolver<Sweep>::StepSolver(const WireMechanics& mechanics)
    : mechanics_(mechanics),
      sweep_(MakeSweep(mechanics)),
      steps_(static_cast<std::size_t>(mechanics.curves())),
      best_(steps_.size()) {
  for (int c = 0; c < curves(); ++c) {
    const WireModel& model = mechanics.model(c);
    for (std::vector<CurveStep>* steps : {&steps_, &best_}) {
      (*steps)[c].Reserve(static_cast<std::size_t>(model.max_segments()) + 1,
                          static_cast<std::size_t>(model.spins()));
    }
  }
  for (const BetweenCurves& between : mechanics.MakeQuadraticModel().between) {
    between_sets_.emplace_back(between.springs.capacity());
  }
}

template <class Sweep>
bool StepSolver<Sweep>::Factor(const WireState& state, const QuadraticModel& at, double weight) {
  if constexpr (kFront) {
    return sweep_.Factor(state, at, weight);
  } else {
    return sweep_.Factor(mechanics_.model(), state, at, weight);
  }
}

template <class Sweep>
bool StepSolver<Sweep>::Refactor(const WireState& state, const QuadraticModel& at, double weight,
                                 int changed) {
  if constexpr (kFront) {
    return sweep_.Refactor(state, at, weight, changed);
  } else {
    return sweep_.Refactor(mechanics_.model(), state, at, weight, changed);
  }
}

template <class Sweep>
double StepSolver<Sweep>::Step(const WireState& state, const QuadraticModel& at) {
  if constexpr (kFront) {
    return sweep_.Step(state, at, steps_);
  } else {
    CurveStep& step = steps_.front();
    return sweep_.Step(mechanics_.model(), state, at, step.xi, step.spin, step.displacement_mm);
  }
}

// Sums the loads of the model with the springs of the active sets.
template <class Sweep>
void StepSolver<Sweep>::TakeLoads(const WireState& state, const std::vector<ActiveSet>& wall_sets,
                                  QuadraticModel& at) const {
  for (int c = 0; c < curves(); ++c) {
    mechanics_.SumActiveLoads(state, c, wall_sets[c].active(), at);
  }
  for (std::size_t k = 0; k < between_sets_.size(); ++k) {
    WireMechanics::SumActiveBetween(between_sets_[k].active(), at.between[k]);
  }
}

template <class Sweep>
void StepSolver<Sweep>::Begin(const WireState& state, bool moved, std::vector<ActiveSet>& wall_sets,
                              QuadraticModel& at) {
  for (int c = 0; c < curves(); ++c) {
    wall_sets[c].Begin(moved, at.curve(c));
  }
  for (std::size_t k = 0; k < between_sets_.size(); ++k) between_sets_[k].Begin(at.between[k]);
  TakeLoads(state, wall_sets, at);
}

// Looks at the springs at s. Returns true if any set is wrong there.
template <class Sweep>
bool StepSolver<Sweep>::AnyWrong(const WireState& state, const QuadraticModel& at,
                                 std::vector<ActiveSet>& wall_sets) {
  bool any = false;
  for (int c = 0; c < curves(); ++c) {
    wall_sets[c].Look(state.curve(c), at.curve(c), steps_[c]);
    any = any || wall_sets[c].is_wrong();
  }
  for (std::size_t k = 0; k < between_sets_.size(); ++k) {
    between_sets_[k].Look(state, mechanics_, at, at.between[k], steps_);
    any = any || between_sets_[k].is_wrong();
  }
  return any;
}

// Sets the active sets to those of x. Returns the most distal change, as Refactor takes it, or -1.
template <class Sweep>
int StepSolver<Sweep>::UpdateSets(const QuadraticModel& at, std::vector<ActiveSet>& wall_sets) {
  if constexpr (!kFront) {
    return wall_sets.front().Update(at);
  } else {
    bool any = false;
    int first = std::numeric_limits<int>::max();
    for (int c = 0; c < curves(); ++c) {
      const int segment = wall_sets[c].Update(at.curve(c));
      if (segment < 0) continue;
      any = true;
      first = std::min(first, sweep_.schedule().OperationOf(c, segment));
    }
    for (std::size_t k = 0; k < between_sets_.size(); ++k) {
      const int group = between_sets_[k].Update(at.between[k]);
      if (group < 0) continue;
      any = true;
      first = std::min(first, sweep_.schedule().OperationOfGroup(static_cast<int>(k), group));
    }
    return any ? std::max(first, 0) : -1;
  }
}

// Sum of value(set) over all sets.
template <class Sweep>
template <class Value>
double StepSolver<Sweep>::Sum(const std::vector<ActiveSet>& wall_sets, Value value) const {
  double sum = 0;
  for (const ActiveSet& set : wall_sets) sum += value(set);
  for (const BetweenSet& set : between_sets_) sum += value(set);
  return sum;
}

// Fraction of the way from x to s at which the one-sided model has its minimum. The model of the
// sets drops by `drop_mJ` on that way, as a parabola with its minimum at s.
template <class Sweep>
double StepSolver<Sweep>::LineMinimum(const std::vector<ActiveSet>& wall_sets,
                                      double drop_mJ) const {
  constexpr int kBisections = 20;
  double low = 0;
  double high = 1;
  for (int k = 0; k < kBisections; ++k) {
    const double fraction = (low + high) / 2;
    const double slope_mJ =
        -2 * (1 - fraction) * drop_mJ -
        Sum(wall_sets, [&](const SpringSet& set) { return set.ExcessSlopeAt(fraction); });
    (slope_mJ < 0 ? low : high) = fraction;
  }
  // Beyond the minimum a wrong spring is wrong at x too, so the set changes.
  return high;
}

// Moves x by a fraction of the way to s. `first`: x is still the zero step.
template <class Sweep>
void StepSolver<Sweep>::MoveBest(double fraction, bool first, std::vector<ActiveSet>& wall_sets) {
  const auto blend = [&](auto& best, const auto& solution) {
    if (first) {
      best = solution;
      for (auto& part : best) part *= fraction;
      return;
    }
    for (std::size_t i = 0; i < best.size(); ++i) best[i] += fraction * (solution[i] - best[i]);
  };
  for (std::size_t c = 0; c < steps_.size(); ++c) {
    blend(best_[c].xi, steps_[c].xi);
    blend(best_[c].spin, steps_[c].spin);
    blend(best_[c].displacement_mm, steps_[c].displacement_mm);
  }
  for (ActiveSet& set : wall_sets) set.MoveBest(fraction);
  for (BetweenSet& set : between_sets_) set.MoveBest(fraction);
}

template <class Sweep>
typename StepSolver<Sweep>::Solution StepSolver<Sweep>::Solve(const WireState& state, double weight,
                                                              bool moved,
                                                              std::vector<ActiveSet>& wall_sets,
                                                              QuadraticModel& at) {
  constexpr int kRounds = 6;
  Begin(state, moved, wall_sets, at);
  int changed = kFront ? 0 : state.segments() - 1;
  double best_mJ = 0;  // of the one-sided model at x
  for (int round = 1;; ++round) {
    const bool definite = Refactor(state, at, weight, changed);
    const double decrease_mJ = definite ? Step(state, at) : kNotFound;
    if (!std::isfinite(decrease_mJ)) return TakeBest(best_mJ, round, false);
    // Energy at s; there the sets' model is the one-sided one if no set is wrong.
    const double solution_mJ =
        Sum(wall_sets, [](const SpringSet& set) { return set.ExcessAtRest(); }) - decrease_mJ;
    if (!AnyWrong(state, at, wall_sets)) {
      return {.expected_mJ = -solution_mJ, .rounds = round, .definite = true};
    }

    const double drop_mJ = best_mJ +
                           Sum(wall_sets, [](const SpringSet& set) { return set.ExcessAtBest(); }) -
                           solution_mJ;
    const double fraction = LineMinimum(wall_sets, drop_mJ);
    const double left = 1 - fraction;
    best_mJ = solution_mJ + left * left * drop_mJ -
              Sum(wall_sets, [&](const SpringSet& set) { return set.ExcessAt(fraction); });
    MoveBest(fraction, round == 1, wall_sets);
    changed = UpdateSets(at, wall_sets);
    if (changed < 0 || round == kRounds) return TakeBest(best_mJ, round, true);
    TakeLoads(state, wall_sets, at);
  }
}

// Uses the best point as the step, if it reduces the energy.
template <class Sweep>
typename StepSolver<Sweep>::Solution StepSolver<Sweep>::TakeBest(double best_mJ, int rounds,
                                                                 bool definite) {
  if (!(best_mJ < 0)) return {.rounds = rounds};
  std::swap(steps_, best_);
  return {.expected_mJ = -best_mJ, .rounds = rounds, .definite = definite};
}

template <class Sweep>
void StepSolver<Sweep>::Apply(const WireState& state, const QuadraticModel& at, double scale,
                              WireState& trial) const {
  for (int c = 0; c < curves(); ++c) {
    const CurveStep& step = steps_[c];
    trial.curve(c).Step(mechanics_.model(c), state.curve(c), at.curve(c).frames, step.xi, step.spin,
                        scale);
  }
}

template <class Sweep>
double StepSolver<Sweep>::LargestTurn() const {
  double squared = 0;
  for (const CurveStep& step : steps_) {
    for (const Vector2d& xi : step.xi) squared = std::max(squared, xi.squaredNorm());
    for (const double zeta : step.spin) squared = std::max(squared, zeta * zeta);
  }
  return std::sqrt(squared);
}

template <class Sweep>
double StepSolver<Sweep>::PassingScale(const WireState& state, const QuadraticModel& at) const {
  constexpr double kFractionOfDistance = 0.5;
  constexpr double kFractionOfTouching = 0.25;  // for curves that are almost in one place
  const auto moved_mm = [&](int curve, int segment, double past_mm) {
    const CurveStep& step = steps_[curve];
    return Vector3d(step.displacement_mm[segment] +
                    at.curve(curve).frames[segment] * (past_mm * step.xi[segment]));
  };
  double scale = 1;
  for (const BetweenCurves& between : at.between) {
    for (const BetweenCurves::Neighbor& neighbor : between.neighbors) {
      const SegmentPair& on = between.groups[neighbor.group];
      const Vector3d& along = state.curve(between.outer).tangents()[on.outer];
      const Vector3d apart_mm = moved_mm(between.inner, on.inner, neighbor.past_mm) -
                                moved_mm(between.outer, on.outer, neighbor.foot_mm);
      const double across_mm = (apart_mm - apart_mm.dot(along) * along).norm();
      const double most_mm = std::max(kFractionOfDistance * neighbor.apart_mm,
                                      kFractionOfTouching * neighbor.touching_mm);
      if (scale * across_mm > most_mm) scale = most_mm / across_mm;
    }
  }
  return scale;
}

template <class Sweep>
bool StepSolver<Sweep>::IsDefinite(const WireState& state, const QuadraticModel& at,
                                   double weight) {
  return Factor(state, at, weight);
}

template <class Sweep>
double StepSolver<Sweep>::LongestMoveMm(const WireState& state, const QuadraticModel& at,
                                        const std::vector<Vector3d>* shift_mm) const {
  double longest_mm = 0;
  for (int c = 0; c < curves(); ++c) {
    longest_mm = std::max(longest_mm, LongestMm(mechanics_.model(c), state.curve(c), at.curve(c),
                                                steps_[c], c == 0 ? shift_mm : nullptr));
  }
  return longest_mm;
}

template <class Sweep>
double StepSolver<Sweep>::NextStepMm(const WireState& state, const QuadraticModel& at,
                                     const std::vector<Vector3d>* shift_mm) {
  if (!IsDefinite(state, at, 0)) return std::numeric_limits<double>::quiet_NaN();
  Step(state, at);
  return LongestMoveMm(state, at, shift_mm);
}

template <class Sweep>
const CurveStep& StepSolver<Sweep>::StepOf(const WireState& state, const QuadraticModel& at) {
  Factor(state, at, 0);
  Step(state, at);
  return steps_.front();
}

template <class Sweep>
void StepSolver<Sweep>::Push(const WireState& state, const QuadraticModel& at, WireState& trial) {
  constexpr double kPush = 1e-4;  // largest turn of a segment, rad
  // All curves get the same push, because the inner instruments move along in the lumen.
  for (int c = 0; c < curves(); ++c) {
    CurveStep& step = steps_[c];
    step.xi.resize(state.curve(c).tangents().size());
    std::uint32_t random = 1;
    for (Vector2d& xi : step.xi) {
      for (double& component : xi) {
        random = 1664525 * random + 1013904223;
        component = kPush * (random / 2147483648.0 - 1);
      }
    }
    step.spin.assign(step.xi.size() * static_cast<std::size_t>(mechanics_.model(c).spins()), 0);
  }
  Apply(state, at, 1, trial);
}

template class StepSolver<RiccatiSweep<BendStage>>;
template class StepSolver<RiccatiSweep<TwistStage>>;
template class StepSolver<FrontSweep>;

}  // namespace torquer
