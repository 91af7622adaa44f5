// Stick-slip law: Coulomb's law with a small slip length d, as an energy with two continuous
// derivatives. With s the displacement of a contact from its anchor and L = mu N, the force is
//   L (3 x - x^3) / 2,  x = |s|/d <= 1   (sticks, elastically)
//   L                   beyond           (slips, at the Coulomb cone exactly)
#pragma once

#include <cmath>

namespace torquer::effects {

/// Energy and derivatives of a friction contact with the limit `limit_N` at a distance from its
/// anchor.
struct StickSlip {
  /// `squared_mm2`: |s|^2; `slip_mm`: d > 0.
  StickSlip(double limit_N, double slip_mm, double squared_mm2) {
    const double x2 = squared_mm2 / (slip_mm * slip_mm);
    if (x2 < 1) {
      const double stiffness = 1.5 * limit_N / slip_mm;
      energy_mJ = stiffness * squared_mm2 * (0.5 - x2 / 12);
      secant_N_mm = stiffness * (1 - x2 / 3);
      softening_N_mm3 = stiffness * 2 / (3 * slip_mm * slip_mm);
    } else {
      const double distance = std::sqrt(squared_mm2);
      energy_mJ = limit_N * (distance - 0.375 * slip_mm);
      secant_N_mm = limit_N / distance;
      softening_N_mm3 = secant_N_mm / squared_mm2;
    }
  }

  double energy_mJ;
  double secant_N_mm;      ///< gradient of the energy = secant times s
  double softening_N_mm3;  ///< Hessian = secant times identity - softening times s s'
};

}  // namespace torquer::effects
