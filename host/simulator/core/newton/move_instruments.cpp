#include "host/simulator/core/newton/move_instruments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "host/simulator/core/wire_model.h"

namespace torquer {

namespace {

// If the other curve is about to lead, both have the same reach before or after the move (Towards).
void MoveTwoCurves(const InstrumentPlaces& next, InstrumentStack& stack, FeedPrediction& prediction,
                   ContactPoints& points, WireState& state) {
  const WireModel& first = stack.rod();
  const WireModel& second = *stack.second_rod();
  const auto exchange_when_equal = [&] {
    if (stack.OuterLeads(next) == state.outer_leads()) return;
    if (state.segments() != state.second()->segments()) return;
    state.ExchangeCurves();
    prediction.Forget();
  };
  const double fed_mm = next.reach_mm() - state.insertion_mm();
  const int segments = state.segments();
  const bool equal = stack.SecondReach(state.places()) == state.insertion_mm();
  if (equal) exchange_when_equal();
  state.MoveBoth(first, second, next);
  prediction.Feed(first, next.reach_mm(), state);
  double reach_mm = 0;  // reach of the present second curve
  for (int k = 0; k < next.size(); ++k) {
    if (&state.CurveOf(k) == state.second()) reach_mm = std::max(reach_mm, next[k].insertion_mm);
  }
  state.FeedSecond(second, segments, fed_mm, reach_mm);
  if (!equal) exchange_when_equal();
  stack.Combine(next, SegmentsShort(state));
  points.TakeRadii();
  state.UpdateCurves(first, second);
}

}  // namespace

int SegmentsShort(const WireState& state) {
  return state.second() == nullptr ? 0 : state.segments() - state.second()->segments();
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
                     FeedPrediction& prediction, ContactPoints& points, WireState& state) {
  if (stack.second_rod() != nullptr) {
    MoveTwoCurves(next, stack, prediction, points, state);
    return;
  }
  const bool alone = next.size() == 1;
  if (!alone) {
    stack.Combine(next);
    points.TakeRadii();
    state.MoveInstruments(stack.rod(), next);
  }
  prediction.Feed(stack.rod(), next.reach_mm(), state);
  if (alone) state.Rotate(next[0].rotation_rad);
}

void MoveSurfaces(const InstrumentPlaces& here, const InstrumentPlaces& next, bool turns,
                  const PointSet& points, const std::vector<EnergyTerm*>& terms) {
  const double fed_mm = next.reach_mm() - here.reach_mm();
  std::array<SurfaceMove, kMostInstruments> moves = {};
  bool any = false;
  for (int k = 0; k < here.size(); ++k) {
    SurfaceMove& move = moves[static_cast<std::size_t>(k)];
    move.along_mm = next[k].insertion_mm - here[k].insertion_mm - fed_mm;
    if (turns) move.turn_rad = next[k].rotation_rad - here[k].rotation_rad;
    any = any || move.along_mm != 0 || move.turn_rad != 0;
  }
  if (!any) return;
  for (EnergyTerm* term : terms) term->MoveSurfaces(points, moves);
}

}  // namespace torquer
