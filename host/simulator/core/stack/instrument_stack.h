// Instruments within each other, as one rod.
//
//   sheath |==========================------------------........   outermost: a guiding catheter,
//          |                                                       in it a microcatheter, in it
//          |  all three: EI adds up      two              one      the guidewire
//
// All lie on one curve. Where several are, rigidities add up, and the rod rests at
//   kappa = sum(EI_k kappa_k) / sum(EI_k)                                        (README (30)),
// every rest curvature turned with its own instrument: as its hand, or where instruments twist, as
// it is turned there (core/README.md section 17). The one that reaches farthest leads: the segments
// of the rod are its material. An instrument that slides in the others changes what the rod is, not
// where it lies; the joint into which a tip falls is partly with and partly without it. Where a tip
// passes that of the leader they coincide, and so do the segments of either as the leading one. A
// lone wire is a stack of one: it is the rod.
#pragma once

#include <memory>
#include <vector>

#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

class InstrumentStack {
 public:
  /// A lone wire, which must outlive this.
  explicit InstrumentStack(const WireModel& wire);
  /// 1 .. kMostInstruments, the innermost first, all with the same segments, law and sheath; all
  /// of them twist, or none. Throws std::invalid_argument where that is not so.
  explicit InstrumentStack(std::vector<WireModel> instruments);
  InstrumentStack(const InstrumentStack&) = delete;
  InstrumentStack& operator=(const InstrumentStack&) = delete;

  int size() const { return static_cast<int>(instruments_.size()); }
  const WireModel& instrument(int k) const { return *instruments_[static_cast<std::size_t>(k)]; }
  /// What they are together, at the places of the last Combine.
  const WireModel& rod() const { return *rod_; }

  /// Insertions within 0 .. the length of each.
  InstrumentPlaces Bounded(const InstrumentPlaces& places) const;
  /// The next places on the way from `here` to `goal`: no insertion changes by more than `feed_mm`,
  /// no rotation by more than `turn_rad`. Insertions keep their proportion, so that all arrive
  /// together; where another instrument is about to lead, it stops beside the leader. The last step
  /// ends at `goal` exactly.
  InstrumentPlaces Towards(const InstrumentPlaces& goal, const InstrumentPlaces& here,
                           double feed_mm, double turn_rad) const;
  /// Makes the rod what the instruments are at these places. O(segments), no heap; nothing to do
  /// for a lone wire.
  void Combine(const InstrumentPlaces& places);

 private:
  std::vector<WireModel> owned_;
  std::vector<const WireModel*> instruments_;
  std::unique_ptr<WireModel> combined_;  ///< null for a lone wire
  const WireModel* rod_;
  std::vector<WireModel::Joint> joints_;
  std::vector<WireModel::TwistingJoint> twisting_;  // empty where none twists
};

/// What an instrument is at a distance from its tip, between its joints.
WireModel::Joint JointAt(const WireModel& model, double from_tip_mm);

/// The nodes of a rod as far as an instrument in it reaches, the last where its tip is. `out` is
/// overwritten.
void TakePart(const WireModel& rod, const WireState& state, double insertion_mm,
              std::vector<Eigen::Vector3d>& out);
/// Where that tip is.
Eigen::Vector3d PointAt(const WireModel& rod, const WireState& state, double insertion_mm);

}  // namespace torquer
