// Wires in contacts that cross: wound up, and head on. Models, and states that are no equilibria.
#pragma once

#include "tests/support/analytic_fields.h"
#include "tests/support/dense_curves.h"

namespace torquer::test {

inline constexpr double kWireMm = 0.2;  // radius

const FreeSpace& NoVessel();
WireModel CoilWire(double ratio, double curvature, const Sheath& sheath, double segment_mm);

// Instruments on one curve, wound up so that each turn presses on the next one.
struct Coil : DenseCurves {
  struct Settings {
    int instruments = 1;
    double ratio = 0;  // GJ over EI; 0 means no twist
    double curvature = 0;
    double segment_mm = 1.3;
    double turns = 1.5;
  };
  Coil(const Settings& s, unsigned seed);
};

// Two wires beside each other; the second one turns back, and faces the first one head on.
struct HeadOn : DenseCurves {
  static constexpr double kApartMm = 0.34;
  HeadOn(double ratio, unsigned seed);
};

// A wire that has left a catheter, turns back, and runs along its outside, head on.
struct TurnedBack : DenseCurves {
  static constexpr double kCatheterMm = 0.7;  // radius
  TurnedBack(double ratio, double apart_mm, unsigned seed, double catheter_mm = 11.2);
  // Contacts of the wire with the outside of the catheter.
  const BetweenCurves& Outside() const;
};

}  // namespace torquer::test
