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
//
// Where a scene gives the lumen of one of them its room, instruments lie on two curves: those
// inside it on one, it and those around it on the other (core/README.md section 18). That of the
// leader is the rod; the other is the second rod, on the same grid.
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

/// Room between the instruments inside a lumen and what they lie in.
struct Clearance {
  int first_outer = 0;  ///< index of the innermost instrument on the outer curve, >= 1; 0: no room
  std::array<double, kMostInstruments> lumen_radius_mm = {};  ///< of each instrument's lumen
  /// Spring of the lumen's wall, per length of wire, N/mm^2, > 0.
  double stiffness_N_mm2 = 0;
};

/// `v` turned by the angle whose cosine and sine are `turn`.
inline Eigen::Vector2d Turned(const Eigen::Vector2d& v, const Eigen::Vector2d& turn) {
  return {turn[0] * v[0] - turn[1] * v[1], turn[1] * v[0] + turn[0] * v[1]};
}

class InstrumentStack {
 public:
  /// A lone wire, which must outlive this.
  explicit InstrumentStack(const WireModel& wire);
  /// 1 .. kMostInstruments, the innermost first, all with the same segments, law and sheath; all
  /// of them twist, or none. Throws std::invalid_argument where that is not so.
  explicit InstrumentStack(std::vector<WireModel> instruments)
      : InstrumentStack(std::move(instruments), Clearance()) {}
  /// The same with room between some of them. Throws std::invalid_argument where what is inside
  /// does not fit.
  InstrumentStack(std::vector<WireModel> instruments, const Clearance& clearance);
  InstrumentStack(const InstrumentStack&) = delete;
  InstrumentStack& operator=(const InstrumentStack&) = delete;

  int size() const { return static_cast<int>(instruments_.size()); }
  const WireModel& instrument(int k) const { return *instruments_[static_cast<std::size_t>(k)]; }
  /// What they are together, at the places of the last Combine; with room between them those on
  /// the leader's curve.
  const WireModel& rod() const { return *rod_; }
  /// Those on the other curve; null where all lie on one. Its end is where that of
  /// WireState::second() is.
  const WireModel* second_rod() const { return second_.get(); }
  const Clearance& clearance() const { return clearance_; }
  /// Whether the outer instruments reach farther than all within them.
  bool OuterLeads(const InstrumentPlaces& places) const {
    return places.Leader() >= clearance_.first_outer;
  }
  /// How far the instruments of the other curve reach, mm.
  double SecondReach(const InstrumentPlaces& places) const;
  /// Radius of the lumen around the inner instruments at an arc length up to which an outer one
  /// reaches, mm.
  double LumenRadius(const InstrumentPlaces& places, double arc_mm) const;
  /// The inner instrument whose surface faces the lumen at an arc length, and the outer one whose
  /// lumen it is there. Where none reaches as far, the one that reaches farthest.
  int InLumenAt(const InstrumentPlaces& places, double arc_mm) const;
  int LumenAt(const InstrumentPlaces& places, double arc_mm) const;
  /// The instruments on the curve that lies inside the lumen, or on the one around it; of one curve
  /// all. From `first` to `last` - 1.
  struct Range {
    int first;
    int last;
  };
  Range OnCurve(bool outer) const {
    if (second_ == nullptr) return {0, size()};
    return outer ? Range{clearance_.first_outer, size()} : Range{0, clearance_.first_outer};
  }

  /// Insertions within 0 .. the length of each.
  InstrumentPlaces Bounded(const InstrumentPlaces& places) const;
  /// The next places on the straight way from `here` to `goal`: no insertion changes by more than
  /// `feed_mm`, no rotation by more than `turn_rad`, but for rounding. All feeds and turns keep
  /// their proportion and arrive together; where another instrument is about to lead, it stops
  /// beside the leader. The last step ends at `goal` exactly.
  InstrumentPlaces Towards(const InstrumentPlaces& goal, const InstrumentPlaces& here,
                           double feed_mm, double turn_rad) const;
  /// Makes the rod what the instruments are at these places. O(segments), no heap; nothing to do
  /// for a lone wire. `short_by`: how many segments the second curve has less than the first.
  void Combine(const InstrumentPlaces& places, int short_by = 0);

 private:
  // An instrument in a rod, and by how much its tip is behind the rod's end.
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
  std::vector<WireModel::TwistingJoint> twisting_;  // empty where none twists
  Clearance clearance_;
  std::unique_ptr<WireModel> second_;  ///< null where all lie on one curve
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
