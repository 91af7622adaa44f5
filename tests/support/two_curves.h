// Bent instruments with clearance in each other's lumens.
#pragma once

#include <array>

#include "host/simulator/core/stack/instrument_stack.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_curves.h"

namespace torquer::test {

// The vessel, constructed before the curves in it.
struct TorusWall {
  Torus field{Side::kInside, 20, 2};
};

// Two to four bent instruments within each other, shaken, in the wall of a torus. Their tips are at
// any place within a segment. `rooms`: the instruments that have room in their lumens; `beside`:
// the one that lies beside the earlier ones.
struct TwoCurves : TorusWall, DenseCurves {
  static constexpr double kSoftest = 6.35e-3;  // N mm^2
  static Sheath Entry() { return {Vector3d(21.8, 0, 0), Vector3d::UnitY()}; }
  Sheath sheath = Entry();

  using Marks = std::array<bool, kMostInstruments>;
  TwoCurves(const InstrumentPoses& poses, int points_per_segment, unsigned seed, double ratio = 0,
            const Marks& rooms = {false, true, false, false}, const Marks& beside = {});
};

inline const InstrumentPoses kWireLeads{{15.1, 0.4}, {10.7, -0.8}};
inline const InstrumentPoses kCatheterLeads{{9.9, 0.4}, {14.3, -0.8}};
// Two instruments on the outer curve.
inline const InstrumentPoses kThreeWireLeads{{15.1, 0.4}, {10.7, -0.8}, {7.3, 0.5}};
inline const InstrumentPoses kThreeCatheterLeads{{9.9, 0.4}, {14.3, -0.8}, {7.3, 0.5}};

}  // namespace torquer::test
