// Instrument stack: instruments within each other, combined to one rod.
//
//   sheath |==========================------------------........   outermost: a guiding catheter,
//          |                                                       in it a microcatheter, in it
//          |  all three: EI adds up      two              one      the guidewire
//
// All lie on one curve. At a place with several instruments, rigidities add up, and the rod rests
// at
//   kappa = sum(EI_k kappa_k) / sum(EI_k)                                        (README (30)).
// Every rest curvature turns with its instrument: with the hand or, with twist, with the local turn
// (core/README.md section 17). The leader is the instrument that reaches farthest: the segments of
// the rod are its material. An instrument that slides in the others changes the rod's properties,
// not its position. A tip divides the joints around it into parts with and parts without the
// instrument. A tip that passes that of the leader coincides with it, and so do
// the segments of both. A lone wire is a stack of one: it is the rod.
//
// Room in a lumen divides the instruments into curves (core/README.md section 18). Curve 0 has the
// innermost ones, and each lumen with room begins another. So does an instrument that lies beside
// the earlier ones. Each curve has its own rod and segments.
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "host/simulator/core/curve.h"
#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/wire_model.h"

namespace torquer {

/// Room in lumens for the instruments inside them, instruments that lie beside others, and contact
/// of an instrument with itself.
struct Clearance {
  /// Entry k: instruments within the lumen of instrument k have room there; k >= 1.
  std::array<bool, kMostInstruments> has_room = {};
  std::array<double, kMostInstruments> lumen_radius_mm = {};  ///< of each instrument's lumen
  /// Entry k: instrument k lies beside the instruments before it, with its own sheath; k >= 1.
  /// The instruments after it lie around all of them, and need room.
  std::array<bool, kMostInstruments> is_beside = {};
  /// Entry k belongs to an instrument that lies beside others. Path along which it lies when it is
  /// inserted at the start, mm. May be empty.
  std::array<std::vector<Eigen::Vector3d>, kMostInstruments> start_path_mm = {};
  /// True if each curve touches itself where it comes near itself.
  bool touches_itself = false;
  /// Contact spring between curves, per length of wire, N/mm^2, > 0 if there are several curves or
  /// a curve touches itself.
  double stiffness_N_mm2 = 0;
};

class InstrumentStack {
 public:
  /// A lone wire, which must outlive this.
  explicit InstrumentStack(const WireModel& wire);
  /// 1 .. kMostInstruments instruments, the innermost first, all with the same segments and law.
  /// All have the same sheath, except an instrument that lies beside others. Either all of them
  /// twist or none does. Throws std::invalid_argument otherwise.
  explicit InstrumentStack(std::vector<WireModel> instruments)
      : InstrumentStack(std::move(instruments), Clearance()) {}
  /// The same with room between some of them, or with one beside others. Throws
  /// std::invalid_argument if the inner instruments do not fit.
  InstrumentStack(std::vector<WireModel> instruments, const Clearance& clearance);
  InstrumentStack(const InstrumentStack&) = delete;
  InstrumentStack& operator=(const InstrumentStack&) = delete;

  int size() const { return static_cast<int>(instruments_.size()); }
  const WireModel& instrument(int k) const { return *instruments_[k]; }
  /// Number of curves on which the instruments lie.
  int curves() const { return static_cast<int>(ranges_.size()); }
  /// Rod of the instruments of a curve at the poses of the last Combine.
  const WireModel& rod(int curve = 0) const { return *rods_[curve]; }
  const Clearance& clearance() const { return clearance_; }
  /// Instruments `first` to `last` - 1 of a curve.
  struct Range {
    int first;
    int last;
  };
  Range OnCurve(int curve) const { return ranges_[curve]; }
  /// Curve on which an instrument lies.
  int CurveOf(int instrument) const;
  /// The next curve around a curve; curves() if there is none.
  int CurveAround(int curve) const;
  /// True if `outer`, of a higher number, lies beside a curve; otherwise it lies around it.
  bool AreBeside(int curve, int outer) const;
  /// Start path of a curve that lies beside others.
  const std::vector<Eigen::Vector3d>& StartPath(int curve) const {
    return clearance_.start_path_mm[OnCurve(curve).first];
  }
  /// Instrument of a curve that reaches farthest; of equals, the innermost.
  int Leader(int curve, const InstrumentPoses& poses) const;
  /// Its insertion, mm: the reach of the curve.
  double Reach(int curve, const InstrumentPoses& poses) const {
    return poses[Leader(curve, poses)].insertion_mm;
  }
  /// Instrument that gives a curve its lumen (the innermost) or its surface (the outermost) at an
  /// arc length. If none reaches it, the one that reaches farthest.
  int LumenAt(int curve, const InstrumentPoses& poses, double arc_mm) const;
  int SurfaceAt(int curve, const InstrumentPoses& poses, double arc_mm) const;

  /// Limits the insertions to 0 .. the length of each instrument.
  InstrumentPoses Bounded(const InstrumentPoses& poses) const;
  /// Next poses on the straight line from `here` to `goal`. Up to rounding, no insertion changes
  /// by more than `feed_mm`, and no rotation by more than `turn_rad`. All feeds and turns keep
  /// their proportion and arrive together. If another instrument of a curve is about to lead it,
  /// the motion stops when it reaches the leader. The last step ends at `goal` exactly.
  InstrumentPoses Towards(const InstrumentPoses& goal, const InstrumentPoses& here, double feed_mm,
                          double turn_rad) const;
  /// Sets the rods to the combined instruments at `poses`. O(segments), no heap; no effect for a
  /// lone wire.
  void Combine(const InstrumentPoses& poses);
  /// Energy of the instruments of a curve that bend each other, at the poses of the last Combine,
  /// mJ. It acts on no shape, so the rod does not have it. 0 if they twist: then their spins have
  /// it.
  double MutualEnergyMJ(int number, const Curve& curve) const;

 private:
  // An instrument in a rod, and the distance of its tip behind the rod's end.
  struct Member {
    const WireModel* model = nullptr;
    std::size_t instrument = 0;
    double behind_mm = 0;
    double near_mm = 0;  // length past the sheath, at most two segments
    Eigen::Vector2d turn = {1, 0};

    bool operator==(const Member&) const = default;
  };
  using Members = std::array<Member, kMostInstruments>;

  bool LiesBeside(int curve) const { return clearance_.is_beside[OnCurve(curve).first]; }
  int Gather(const InstrumentPoses& poses, Range range, double end_mm, Members& members) const;
  void CombineRod(const Members& members, int first, int count, WireModel& rod);
  static double MutualOf(const Members& members, int count, const JointIntegrals& integrals);
  void CombineTwists(const Members& members, int count, const JointIntegrals& integrals,
                     double from_tip_mm, WireModel::TwistingJoint& joint) const;

  std::vector<WireModel> owned_;
  std::vector<const WireModel*> instruments_;
  std::vector<std::unique_ptr<WireModel>> combined_;  // by curve; empty for a lone wire
  std::vector<const WireModel*> rods_;                // by curve
  std::vector<Range> ranges_;                         // by curve
  std::vector<Members> members_;                      // by curve: of its rod
  std::vector<WireModel::Joint> joints_;
  std::vector<WireModel::TwistingJoint> twisting_;  // empty without twist
  Clearance clearance_;
};

/// Nodes of a rod up to an instrument's insertion; the last is the instrument's tip. Overwrites
/// `out`.
void TakeNodes(const WireModel& rod, const Curve& curve, double insertion_mm,
               std::vector<Eigen::Vector3d>& out);
/// Number of nodes of that part before the tip.
int NodesBefore(const WireModel& rod, const Curve& curve, double insertion_mm);
/// Position of that tip.
Eigen::Vector3d PointAt(const WireModel& rod, const Curve& curve, double insertion_mm);

}  // namespace torquer
