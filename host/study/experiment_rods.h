// Rods outside a vessel, held and loaded as in experiments.
#pragma once

#include <vector>

namespace torquer::study {

/// A straight rod, clamped at one end.
struct ClampedRod {
  double length_mm = 0;
  double rigidity_N_mm2 = 0;
  double weight_N_mm = 0;  ///< of a millimeter of it, across the clamp's direction
  double end_force_N = 0;  ///< on its free end, in the same direction
};

/// It at rest.
struct BentRod {
  double segment_mm = 0;
  double deflection_mm = 0;                 ///< of the free end, in the direction of the loads
  std::vector<double> curvatures_1_per_mm;  ///< at joint k, k segments from the clamp
  /// At the joint nearest to a distance from the clamp, which is at most the rod's length.
  double CurvatureAt(double from_clamp_mm) const;
};

/// `segment_mm` goes into the length a whole number of times. Throws std::runtime_error if the rod
/// does not come to rest.
BentRod Bend(const ClampedRod& rod, double segment_mm);

/// The even load, N/mm, that bends a clamped rod to a curvature at a distance from the clamp, and
/// the rod under it. What the load in `rod` is does not matter.
struct EvenLoad {
  double load_N_mm = 0;
  BentRod rod;
};
EvenLoad BendTo(ClampedRod rod, double curvature_1_per_mm, double from_clamp_mm, double segment_mm);

/// The force, N, with which a straight rod between two clamps resists being shortened once it has
/// bent out, as the shortening goes to nothing: its buckling load. `segments` >= 2. Errors as Bend.
double BucklingForce(double length_mm, double rigidity_N_mm2, int segments);

}  // namespace torquer::study
