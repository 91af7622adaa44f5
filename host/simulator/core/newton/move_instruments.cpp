#include "host/simulator/core/newton/move_instruments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "host/simulator/core/wire_model.h"

namespace torquer {

void LayCurves(const InstrumentStack& stack, WireState& state) {
  const std::vector<Eigen::Vector3d> path_mm(state.nodes().begin() + 1, state.nodes().end());
  const InstrumentPlaces places = state.places();
  state.RemoveOthers(stack.curves());
  for (int c = 0; c < stack.curves(); ++c) {
    Curve& curve =
        c == 0 ? state : state.AddCurve(stack.rod(c), places.size(), stack.OnCurve(c).first);
    const std::vector<Eigen::Vector3d>& own_mm = stack.StartPath(c);
    curve.LayAlong(stack.rod(c), own_mm.empty() ? path_mm : own_mm, places, stack.Reach(c, places));
  }
}

double FractionOfWay(const InstrumentPlaces& here, const InstrumentPlaces& next,
                     const InstrumentPlaces& goal, double feed_mm, double turn_rad) {
  double longest = 0;
  double fraction = 1;
  const auto take = [&](double from, double to, double end, double part) {
    const double parts = std::abs(end - from) / part;
    if (parts <= longest) return;
    longest = parts;
    fraction = (to - from) / (end - from);
  };
  for (int k = 0; k < here.size(); ++k) {
    take(here[k].insertion_mm, next[k].insertion_mm, goal[k].insertion_mm, feed_mm);
    take(here[k].rotation_rad, next[k].rotation_rad, goal[k].rotation_rad, turn_rad);
  }
  return fraction;
}

int CountActions(const InstrumentPlaces& here, const InstrumentPlaces& next) {
  int actions = 0;
  for (int k = 0; k < here.size(); ++k) {
    actions += (next[k].insertion_mm != here[k].insertion_mm) +
               (next[k].rotation_rad != here[k].rotation_rad);
  }
  return actions;
}

void MoveInstruments(const InstrumentPlaces& next, InstrumentStack& stack,
                     std::vector<FeedPrediction>& predictions, WireMechanics& mechanics,
                     WireState& state) {
  const bool alone = next.size() == 1;
  if (!alone) stack.Combine(next);
  for (int c = 0; c < stack.curves(); ++c) {
    Curve& curve = state.curve(c);
    if (!alone) {
      mechanics.points(c).TakeRadii();
      curve.MoveInstruments(stack.rod(c), next);
    }
    predictions[static_cast<std::size_t>(c)].Feed(stack.rod(c), stack.Reach(c, next), curve);
  }
  if (alone) state.Rotate(next[0].rotation_rad);
}

void MoveSurfaces(const InstrumentStack& stack, const InstrumentPlaces& here,
                  const InstrumentPlaces& next, bool turns, const Expansion& at,
                  const std::vector<EnergyTerm*>& terms) {
  std::array<SurfaceMove, kMostInstruments> moves = {};
  bool any = false;
  for (int c = 0; c < stack.curves(); ++c) {
    const double fed_mm = stack.Reach(c, next) - stack.Reach(c, here);
    for (int k = stack.OnCurve(c).first; k < stack.OnCurve(c).last; ++k) {
      SurfaceMove& move = moves[static_cast<std::size_t>(k)];
      move.along_mm = next[k].insertion_mm - here[k].insertion_mm - fed_mm;
      if (turns) move.turn_rad = next[k].rotation_rad - here[k].rotation_rad;
      any = any || move.along_mm != 0 || move.turn_rad != 0;
    }
  }
  if (!any) return;
  for (EnergyTerm* term : terms) {
    for (int c = 0; c < stack.curves(); ++c) term->MoveSurfaces(at.curve(c).points, moves);
  }
}

}  // namespace torquer
