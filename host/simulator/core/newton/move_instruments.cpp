#include "host/simulator/core/newton/move_instruments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "host/simulator/core/wire_model.h"

namespace torquer {

void LayCurves(const CombinedRods& rods, WireState& state) {
  const InstrumentStack& stack = rods.stack();
  const std::vector<Eigen::Vector3d> path_mm(state.nodes().begin() + 1, state.nodes().end());
  const InstrumentPoses poses = state.poses();
  state.RemoveOthers(stack.curves());
  for (int c = 0; c < stack.curves(); ++c) {
    Curve& curve = c == 0 ? state : state.AddCurve(rods[c], poses.size(), stack.OnCurve(c).first);
    const std::vector<Eigen::Vector3d>& own_mm = stack.StartPath(c);
    curve.LayAlong(rods[c], own_mm.empty() ? path_mm : own_mm, poses, stack.Reach(c, poses));
  }
}

double FractionOfMotion(const InstrumentPoses& here, const InstrumentPoses& next,
                        const InstrumentPoses& goal, double feed_mm, double turn_rad) {
  double longest = 0;
  double fraction = 1;
  const auto take = [&](double from, double to, double end, double step) {
    const double steps = std::abs(end - from) / step;
    if (steps <= longest) return;
    longest = steps;
    fraction = (to - from) / (end - from);
  };
  for (int k = 0; k < here.size(); ++k) {
    take(here[k].insertion_mm, next[k].insertion_mm, goal[k].insertion_mm, feed_mm);
    take(here[k].rotation_rad, next[k].rotation_rad, goal[k].rotation_rad, turn_rad);
  }
  return fraction;
}

InstrumentPoses NextPoses(const InstrumentStack& stack, const InstrumentPoses& here,
                          const InstrumentPoses& goal, double feed_mm, double turn_rad) {
  constexpr double kRounding = 1e-10;  // of the number of parts
  double parts = 1;
  for (int k = 0; k < here.size(); ++k) {
    parts = std::max({parts, std::abs(goal[k].insertion_mm - here[k].insertion_mm) / feed_mm,
                      std::abs(goal[k].rotation_rad - here[k].rotation_rad) / turn_rad});
  }
  const double share = parts / std::ceil(parts - kRounding);
  return stack.Towards(goal, here, share * feed_mm, share * turn_rad);
}

int CountActions(const InstrumentPoses& here, const InstrumentPoses& next) {
  int actions = 0;
  for (int k = 0; k < here.size(); ++k) {
    actions += (next[k].insertion_mm != here[k].insertion_mm) +
               (next[k].rotation_rad != here[k].rotation_rad);
  }
  return actions;
}

namespace {

// Component of a direction across another one.
Eigen::Vector3d Across(const Eigen::Vector3d& direction, const Eigen::Vector3d& along) {
  return direction - direction.dot(along) * along;
}

// Direction in which a feed moves a segment: its own tangent. The tip moves with the end of the
// shaft.
const Eigen::Vector3d& FedAlong(const WireModel& rod, const Curve& curve, int segment) {
  const int shaft = std::max(1, curve.segments() - rod.tip_segments());
  return curve.tangents()[std::min(segment, shaft - 1)];
}

}  // namespace

PassingLimits FindPassingLimits(const WireState& state, const WireMechanics& mechanics,
                                const std::vector<BetweenCurves>& between) {
  constexpr double kFractionOfDistance = 0.5;    // of two instruments, for one feed
  constexpr double kFractionOfPrediction = 0.1;  // same for each of two predictions
  constexpr double kInfinite = std::numeric_limits<double>::infinity();
  PassingLimits limits{kInfinite, kInfinite};
  for (const BetweenCurves& pair : between) {
    const Curve& inner = state.curve(pair.inner);
    const Curve& outer = state.curve(pair.outer);
    for (const BetweenCurves::Neighbor& neighbor : pair.neighbors) {
      const SegmentPair& on = pair.groups[neighbor.group];
      const Eigen::Vector3d& along = outer.tangents()[on.outer];
      const double apart_mm = std::max(neighbor.apart_mm, neighbor.touching_mm / 2);
      const double across =
          Across(FedAlong(mechanics.model(pair.inner), inner, on.inner), along).norm() +
          Across(FedAlong(mechanics.model(pair.outer), outer, on.outer), along).norm();
      limits.predicted_mm = std::min(limits.predicted_mm, kFractionOfPrediction * apart_mm);
      if (across > 0)
        limits.feed_mm = std::min(limits.feed_mm, kFractionOfDistance * apart_mm / across);
    }
  }
  return limits;
}

void MoveInstruments(const InstrumentPoses& next, double predicted_mm, const CombinedRods& rods,
                     std::vector<FeedPrediction>& predictions, WireState& state) {
  const bool alone = next.size() == 1;
  const InstrumentStack& stack = rods.stack();
  for (int c = 0; c < stack.curves(); ++c) {
    Curve& curve = state.curve(c);
    if (!alone) curve.MoveInstruments(rods[c], next);
    predictions[c].Feed(rods[c], stack.Reach(c, next), predicted_mm, curve);
  }
  if (alone) state.Rotate(next[0].rotation_rad);
}

void MoveSurfaces(const InstrumentStack& stack, const InstrumentPoses& here,
                  const InstrumentPoses& next, bool turns, const QuadraticModel& at,
                  const std::vector<EnergyTerm*>& terms) {
  std::array<SurfaceMove, kMostInstruments> moves = {};
  bool any = false;
  for (int c = 0; c < stack.curves(); ++c) {
    const double fed_mm = stack.Reach(c, next) - stack.Reach(c, here);
    for (int k = stack.OnCurve(c).first; k < stack.OnCurve(c).last; ++k) {
      SurfaceMove& move = moves[k];
      move.along_mm = next[k].insertion_mm - here[k].insertion_mm - fed_mm;
      if (turns) move.turn_rad = next[k].rotation_rad - here[k].rotation_rad;
      any = any || move.along_mm != 0 || move.turn_rad != 0;
    }
  }
  if (!any) return;
  for (EnergyTerm* term : terms) {
    ContactTerm* contact = term->contact_term();
    if (contact == nullptr) continue;
    for (int c = 0; c < stack.curves(); ++c) contact->MoveSurfaces(at.curve(c).points, moves);
  }
}

}  // namespace torquer
