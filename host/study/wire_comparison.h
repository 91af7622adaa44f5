// Wire comparison: differences between two shapes of one wire, also with different segments.
#pragma once

#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer::study {

/// Resamples the shape of `from` with the segments of `model`. The new nodes lie on the old
/// polyline; rotation and insertion are unchanged.
WireState Recut(const WireModel& model, const WireState& from);

/// Distances of the same material points of two wires (equal distance from the tip), mm. The first
/// is at the tip, the next every 0.5 mm, over the length that both have inserted.
std::vector<double> Distances(const WireModel& model_a, const WireState& a,
                              const WireModel& model_b, const WireState& b);

struct WireDistance {
  double mean_mm = 0;
  double max_mm = 0;
};

/// Mean and maximum of Distances(); 0 if there are none.
WireDistance Compare(const WireModel& model_a, const WireState& a, const WireModel& model_b,
                     const WireState& b);

/// Largest penetration of the wire's surface into the wall, mm, sampled every 0.1 mm of the
/// polyline. Unlike the penetration at contact points, it is comparable across segment lengths.
double DeepestPenetration(const WireModel& model, const ClearanceField& field,
                          const WireState& state);

/// Largest unbalanced moment over the segments, per segment length and divided by the local EI,
/// 1/mm^2. A moment per length is an unbalanced transverse force. It is divided by EI/(1 mm)^2, the
/// force that bends a millimeter of this wire by a radian. The result does not depend on the
/// segment length. `gradient`: from a QuadraticModel at `state`.
double ResidualPerLength(const WireModel& model, const WireState& state,
                         const std::vector<Eigen::Vector2d>& gradient);

/// True if two shapes of equal insertion lie in one basin. Relaxed without friction, both then
/// reach the same minimum (closer than `tolerance_mm` everywhere).
bool InOneBasin(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const WireState& a, const WireState& b, double tolerance_mm);

}  // namespace torquer::study
