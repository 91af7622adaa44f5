// Experiment rods: rods outside a vessel, clamped and loaded as in experiments.
#pragma once

#include <vector>

namespace torquer::study {

/// Straight rod, clamped at one end.
struct ClampedRod {
  double length_mm = 0;
  double rigidity_N_mm2 = 0;
  double weight_N_mm = 0;  ///< weight per length, perpendicular to the clamp's direction
  double end_force_N = 0;  ///< force on its free end, in the direction of the weight
};

/// Clamped rod in equilibrium.
struct BentRod {
  double segment_mm = 0;
  double deflection_mm = 0;  ///< deflection of the free end in the direction of the loads
  std::vector<double> curvatures_1_per_mm;  ///< at joint k, k segments from the clamp
  /// Curvature at the joint nearest to `from_clamp_mm`, which is at most the rod's length.
  double CurvatureAt(double from_clamp_mm) const;
};

/// Computes the equilibrium. The length must be a multiple of `segment_mm`. Throws
/// std::runtime_error if the rod does not converge.
BentRod Bend(const ClampedRod& rod, double segment_mm);

/// Uniform load, N/mm, and the clamped rod under it. The load gives a required curvature at a
/// distance from the clamp. The load in the argument `rod` is ignored.
struct EvenLoad {
  double load_N_mm = 0;
  BentRod rod;
};
EvenLoad BendTo(ClampedRod rod, double curvature_1_per_mm, double from_clamp_mm, double segment_mm);

/// Buckling load, N, of a straight rod between two clamps. It is the axial force of the buckled rod
/// in the limit of zero shortening. `segments` >= 2. Errors as Bend.
double BucklingForce(double length_mm, double rigidity_N_mm2, int segments);

}  // namespace torquer::study
