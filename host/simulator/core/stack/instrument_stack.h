// Instrument stack: instruments within each other, combined to one rod.
//
//   sheath |==========================------------------........   outermost: a guiding catheter,
//          |                                                       in it a microcatheter, in it
//          |  all three: EI adds up      two              one      the guidewire
//
// All lie on one curve. At a place with several instruments, rigidities add up, and the rod rests
// at
//   kappa = sum(EI_k kappa_k) / sum(EI_k)                                        (README (30)).
// Every rest curvature turns with its own instrument: with its hand or, with twist, with its local
// turn (core/README.md section 17). The leader is the instrument that reaches farthest: the
// segments of the rod are its material. An instrument that slides in the others changes the rod's
// properties, not its position. A tip divides the joint in which it lies into a part with and a
// part without the instrument. A tip that passes that of the leader coincides with it, and so do
// the segments of both. A lone wire is a stack of one: it is the rod.
//
// With room in the lumen of one instrument, the instruments lie on two curves. One holds those
// inside the lumen, the other that instrument and those around it (core/README.md section 18). The
// leader's curve is the rod; the other is the second rod, on the same grid.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Room in a lumen for the instruments inside it.
struct Clearance {
  int first_outer = 0;  ///< index of the innermost instrument on the outer curve, >= 1; 0: no room
  std::array<double, kMostInstruments> lumen_radius_mm = {};  ///< of each instrument's lumen
  /// Spring of the lumen's wall, per length of wire, N/mm^2, > 0.
  double stiffness_N_mm2 = 0;
};

/// `v` turned by an angle; `turn` is its cosine and sine.
inline Eigen::Vector2d Turned(const Eigen::Vector2d& v, const Eigen::Vector2d& turn) {
  return {turn[0] * v[0] - turn[1] * v[1], turn[1] * v[0] + turn[0] * v[1]};
}

class InstrumentStack {
 public:
  /// A lone wire, which must outlive this.
  explicit InstrumentStack(const WireModel& wire);
  /// 1 .. kMostInstruments instruments, the innermost first, all with the same segments, law and
  /// sheath. Either all of them twist or none does. Throws std::invalid_argument otherwise.
  explicit InstrumentStack(std::vector<WireModel> instruments)
      : InstrumentStack(std::move(instruments), Clearance()) {}
  /// The same with room between some of them. Throws std::invalid_argument if the inner instruments
  /// do not fit.
  InstrumentStack(std::vector<WireModel> instruments, const Clearance& clearance);
  InstrumentStack(const InstrumentStack&) = delete;
  InstrumentStack& operator=(const InstrumentStack&) = delete;

  int size() const { return static_cast<int>(instruments_.size()); }
  const WireModel& instrument(int k) const { return *instruments_[static_cast<std::size_t>(k)]; }
  /// Rod of all instruments at the places of the last Combine. With room in a lumen, only of those
  /// on the leader's curve.
  const WireModel& rod() const { return *rod_; }
  /// Rod of the instruments on the other curve; null for one curve. Its end is that of
  /// WireState::second().
  const WireModel* second_rod() const { return second_.get(); }
  const Clearance& clearance() const { return clearance_; }
  /// True if the outer instruments reach farther than all within them.
  bool OuterLeads(const InstrumentPlaces& places) const {
    return places.Leader() >= clearance_.first_outer;
  }
  /// Reach of the instruments on the other curve, mm.
  double SecondReach(const InstrumentPlaces& places) const;
  /// Radius of the lumen around the inner instruments at an arc length, mm. An outer instrument
  /// must reach that arc length.
  double LumenRadius(const InstrumentPlaces& places, double arc_mm) const;
  /// Instrument whose surface faces the lumen at an arc length, and instrument of that lumen. If
  /// none reaches it, the one that reaches farthest.
  int InLumenAt(const InstrumentPlaces& places, double arc_mm) const;
  int LumenAt(const InstrumentPlaces& places, double arc_mm) const;
  /// Instruments `first` to `last` - 1 on the curve around the lumen or inside it. For one curve
  /// these are all instruments.
  struct Range {
    int first;
    int last;
  };
  Range OnCurve(bool outer) const {
    if (second_ == nullptr) return {0, size()};
    return outer ? Range{clearance_.first_outer, size()} : Range{0, clearance_.first_outer};
  }

  /// Limits the insertions to 0 .. the length of each instrument.
  InstrumentPlaces Bounded(const InstrumentPlaces& places) const;
  /// Next places on the straight line from `here` to `goal`. Up to rounding, no insertion changes
  /// by more than `feed_mm`, and no rotation by more than `turn_rad`. All feeds and turns keep
  /// their proportion and arrive together. If another instrument is about to lead, the motion stops
  /// when it reaches the leader. The last step ends at `goal` exactly.
  InstrumentPlaces Towards(const InstrumentPlaces& goal, const InstrumentPlaces& here,
                           double feed_mm, double turn_rad) const;
  /// Sets the rod to the combined instruments at `places`. O(segments), no heap; does nothing for a
  /// lone wire. `short_by`: number of segments that the second curve lacks against the first.
  void Combine(const InstrumentPlaces& places, int short_by = 0);

 private:
  // An instrument in a rod, and the distance of its tip behind the rod's end.
  struct Member {
    const WireModel* model = nullptr;
    std::size_t instrument = 0;
    double behind_mm = 0;
    Eigen::Vector2d turn = {1, 0};
  };
  using Members = std::array<Member, kMostInstruments>;

  int Gather(const InstrumentPlaces& places, int first, int last, double end_mm,
             Members& members) const;
  void CombineRod(const Members& members, int first, int count, WireModel& rod);
  void CombineJoints(const Members& members, int count, const WireModel& rod);
  void CombineTwists(const Members& members, int count, double lambda);

  std::vector<WireModel> owned_;
  std::vector<const WireModel*> instruments_;
  std::unique_ptr<WireModel> combined_;  ///< null for a lone wire
  const WireModel* rod_;
  std::vector<WireModel::Joint> joints_;
  std::vector<WireModel::TwistingJoint> twisting_;  // empty without twist
  Clearance clearance_;
  std::unique_ptr<WireModel> second_;  ///< null for one curve
};

/// Properties of an instrument at a distance from its tip, interpolated between its joints.
WireModel::Joint JointAt(const WireModel& model, double from_tip_mm);

/// Nodes of a rod up to an instrument's insertion; the last is the instrument's tip. Overwrites
/// `out`.
void TakePart(const WireModel& rod, const WireState& state, double insertion_mm,
              std::vector<Eigen::Vector3d>& out);
/// Position of that tip.
Eigen::Vector3d PointAt(const WireModel& rod, const WireState& state, double insertion_mm);

}  // namespace torquer
