// Instrument stack: instruments within each other, and the curves on which they lie. It stays
// constant while they are simulated.
//
// Instruments without room between them lie on one curve. Its leader is the instrument that reaches
// farthest: the segments of the curve are its material. A tip that passes that of the leader
// coincides with it. At that moment, so do the segments of both. combined_rods.h adds up the
// instruments of a curve.
//
// Room in a lumen divides the instruments into curves (core/README.md section 18). Curve 0 has the
// innermost ones, and each lumen with room begins another. So does an instrument that lies beside
// the earlier ones. Each curve has its own segments.
#pragma once

#include <Eigen/Core>
#include <array>
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
  /// Rod of a curve before its instruments are inserted. It has the sheath, segments, spins and
  /// largest length of the curve. CombinedRods has the rods of inserted instruments.
  const WireModel& empty_rod(int curve = 0) const {
    return empty_rods_.empty() ? instrument(0) : empty_rods_[curve];
  }
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

 private:
  bool LiesBeside(int curve) const { return clearance_.is_beside[OnCurve(curve).first]; }

  std::vector<WireModel> owned_;
  std::vector<const WireModel*> instruments_;
  std::vector<Range> ranges_;          // by curve
  std::vector<WireModel> empty_rods_;  // by curve; empty for a lone wire
  Clearance clearance_;
};

/// Nodes of a curve up to an instrument's insertion; the last is the instrument's tip. `model`: an
/// instrument or the rod of the curve. Overwrites `out`.
void TakeNodes(const WireModel& model, const Curve& curve, double insertion_mm,
               std::vector<Eigen::Vector3d>& out);
/// Number of nodes of that part before the tip.
int NodesBefore(const WireModel& model, const Curve& curve, double insertion_mm);
/// Position of that tip.
Eigen::Vector3d PointAt(const WireModel& model, const Curve& curve, double insertion_mm);

}  // namespace torquer
