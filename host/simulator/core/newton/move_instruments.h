// Motion of the instruments of a state by one part of the way to their targets.
#pragma once

#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/newton/feed_prediction.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Gives a state that was laid as one curve (WireState::Along) all curves of `rods`. Each lies
/// along the same path, as far as its instruments reach.
void LayCurves(const CombinedRods& rods, WireState& state);

/// Fraction of the motion from `here` to `goal` that the motion to `next` covers. All motions are
/// proportional, so the longest one defines it, counted in parts of `feed_mm` and `turn_rad`. A
/// tiny motion would consist only of rounding.
double FractionOfMotion(const InstrumentPoses& here, const InstrumentPoses& next,
                        const InstrumentPoses& goal, double feed_mm, double turn_rad);

/// Poses after the next part of the motion from `here` to `goal`. Parts are equal, feed at most
/// `feed_mm` and turn at most `turn_rad`.
InstrumentPoses NextPoses(const InstrumentStack& stack, const InstrumentPoses& here,
                          const InstrumentPoses& goal, double feed_mm, double turn_rad);

/// Number of insertions and rotations that differ.
int CountActions(const InstrumentPoses& here, const InstrumentPoses& next);

/// Limits of a move with which instruments beside each other cannot pass through each other, mm.
/// Infinite if none are near.
struct PassingLimits {
  double feed_mm;
  double predicted_mm;  ///< displacement of a node by the prediction
};
PassingLimits FindPassingLimits(const WireState& state, const WireMechanics& mechanics,
                                const std::vector<BetweenCurves>& between);

/// Feeds and turns the curves of `state` to `next`, for which `rods` are combined.
/// `predictions`: one for each curve; they move no node by more than `predicted_mm`.
void MoveInstruments(const InstrumentPoses& next, double predicted_mm, const CombinedRods& rods,
                     std::vector<FeedPrediction>& predictions, WireState& state);

/// Moves the surfaces that `terms` remember at the points of `at` from `here` to `next`, before the
/// points move. Inside another instrument, the outer instrument's surface touches the wall and
/// follows its own hand. `turns`: surfaces follow the rotations of the hands too. The surface of an
/// instrument that twists turns with its normals instead.
void MoveSurfaces(const InstrumentStack& stack, const InstrumentPoses& here,
                  const InstrumentPoses& next, bool turns, const QuadraticModel& at,
                  const std::vector<EnergyTerm*>& terms);

}  // namespace torquer
