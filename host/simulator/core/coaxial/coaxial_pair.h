// A wire in a catheter, as one rod.
//
// Both lie on one curve: from the sheath to the nearer of the two tips side by side, beyond it the
// one that goes on, which leads. Its segments are those of the rod. Where both are, rigidities add
// up, and the rod rests at
//   kappa = (EI_w kappa_w + EI_c kappa_c) / (EI_w + EI_c),
// every rest curvature turned with its own instrument; the joint into which the nearer tip falls is
// that much of the one and of the other. An instrument that slides in the other changes what the
// rod is, not where it lies; where the tips pass each other they coincide, and so do the segments
// of either as the leading one.
#pragma once

#include <vector>

#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// How far an instrument has been pushed and turned.
struct InstrumentPlace {
  double insertion_mm = 0;
  double rotation_rad = 0;
};

class CoaxialPair {
 public:
  /// Both with the same segments, law and sheath, and neither twisting; throws
  /// std::invalid_argument where that is not so.
  CoaxialPair(WireModel wire, WireModel catheter);
  CoaxialPair(const CoaxialPair&) = delete;
  CoaxialPair& operator=(const CoaxialPair&) = delete;

  const WireModel& wire() const { return wire_; }
  const WireModel& catheter() const { return catheter_; }
  /// The rod, at the places of the last Place.
  const WireModel& rod() const { return rod_; }

  const InstrumentPlace& wire_place() const { return wire_place_; }
  const InstrumentPlace& catheter_place() const { return catheter_place_; }
  /// How far the rod reaches: the farther of the two, mm.
  double reach_mm() const;

  /// Puts the instruments somewhere: the rod becomes what they are there. O(segments), no heap.
  void Place(const InstrumentPlace& wire, const InstrumentPlace& catheter);

 private:
  WireModel wire_;
  WireModel catheter_;
  WireModel rod_;
  InstrumentPlace wire_place_;
  InstrumentPlace catheter_place_;
  std::vector<WireModel::Joint> joints_;
};

/// The nodes of a rod as far as an instrument in it reaches, the last where its tip is. `out` is
/// overwritten.
void TakePart(const WireModel& rod, const WireState& state, double insertion_mm,
              std::vector<Eigen::Vector3d>& out);
/// Where that tip is.
Eigen::Vector3d PointAt(const WireModel& rod, const WireState& state, double insertion_mm);

}  // namespace torquer
