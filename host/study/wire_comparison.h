// What tells two shapes of one wire apart, whatever their segments.
#pragma once

#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer::study {

/// The shape of `from` in the segments of `model`: its nodes on the old polyline, rotation and
/// insertion the same.
WireState Recut(const WireModel& model, const WireState& from);

/// Distance of the same material points of two wires (the same distance from the tip), mm: at the
/// tip first, then every 0.5 mm, over what both have inserted.
std::vector<double> Distances(const WireModel& model_a, const WireState& a,
                              const WireModel& model_b, const WireState& b);

struct WireDistance {
  double mean_mm = 0;
  double max_mm = 0;
};

/// Mean and largest of Distances; 0 where there are none.
WireDistance Compare(const WireModel& model_a, const WireState& a, const WireModel& model_b,
                     const WireState& b);

/// The largest penetration of the wire's surface into the wall, mm, looked at every 0.1 mm of the
/// polyline: comparable across segments, unlike that of the contact points.
double DeepestPenetration(const WireModel& model, const ClearanceField& field,
                          const WireState& state);

/// The largest out-of-balance moment over segments, a millimeter of segment, over the local EI:
/// 1/mm^2. A moment a length is the transverse force that nothing balances; over EI/(1 mm)^2, the
/// force that bends a millimeter of this wire by a radian, it is a number that refining segments
/// does not change. `gradient` is that of an Expansion at `state`.
double ResidualPerLength(const WireModel& model, const WireState& state,
                         const std::vector<Eigen::Vector2d>& gradient);

/// Whether two shapes of equal insertion lie in one basin: relaxed without friction, both come to
/// rest in the same minimum (nearer than `tolerance_mm` everywhere).
bool InOneBasin(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const WireState& a, const WireState& b, double tolerance_mm);

}  // namespace torquer::study
