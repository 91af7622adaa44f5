// Physical Relaxation: the segment updates of Baier et al. 2016, section 3.1.
//
// The paper's segment i = 1 .. n is segment i - 1 here, its joint i is joint i. Equation numbers
// are the paper's. Rest shape: joint i bends about r, the direction in which its distal segment
// rests, so the paper's omega_{i+1} / lambda is r_{i+1} - u_i; as in eq. (5a) and (5b) its turning
// with u_i enters no force. What turns when segment i is updated: the rest directions of all distal
// joints, fixed to normals that are carried along the wire without twist.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// How the step of a segment follows from its force: accuracy against time, in the paper's order.
enum class UpdateRule {
  kSigned,     ///< (16): diverges where rho - u.B is negative
  kRhoOnly,    ///< (17)
  kAbsolute,   ///< (19): what the paper uses
  kExactRoot,  ///< the root of the equation before (19)
};

struct PhysicalSettings {
  UpdateRule rule = UpdateRule::kAbsolute;
  double max_update = 0.1;  ///< du_max of (18); infinity: unbounded, as the paper's predecessor
  int margin = 5;           ///< segments past the tip that a Tip Relaxation updates fully, and the
                            ///< stride of its single updates; more for a very stiff wire
  /// Part of a cycle's n iterations that is carried out, the first ones: in (0, 1]. Less than 1
  /// makes incomplete cycles, which leave the proximal end as it is.
  double cycle_fraction = 1;
  /// Skip look-ups of nodes that provably cannot touch. Every update stays the same to the bit.
  bool skip_lookups = true;
};

/// Updates single segments and, made of them, Tip Relaxations and cycles.
class PhysicalRelaxation {
 public:
  PhysicalRelaxation(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                     const PhysicalSettings& settings);

  /// To be called whenever the state was changed by anything but this object.
  void Restart(WireState& state);

  /// Goes on from where `twin` stands.
  void CopyFrom(const PhysicalRelaxation& twin);

  /// PhysicalUpdate (3.1.4) of `segment`. Returns |du|.
  double Update(int segment, WireState& state);

  /// m = M + margin, but at most n.
  int TipIterations(const WireState& state) const;
  /// Tip Relaxation (3.1): the first m iterations of a cycle, then single updates of every
  /// margin-th segment to the proximal end.
  void RelaxTip(WireState& state);

  /// A cycle: iteration k = 1 .. n updates the last k segments, distal first. Interruptible: does
  /// at most `updates` more of the cycle and returns true when it has ended.
  bool ContinueCycle(std::int64_t updates, WireState& state);
  /// The next ContinueCycle starts a new cycle.
  void InterruptCycle() {
    iteration_ = 1;
    next_ = 0;
  }

  std::int64_t updates() const { return updates_; }  ///< since construction
  double mean_update_rms() const;                    ///< of |du| over the last cycle
  /// Field look-ups since construction.
  std::int64_t lookups() const { return lookups_; }

 private:
  Eigen::Vector3d WallGradient(int first_node, const WireState& state);

  const WireModel& model_;
  const ClearanceField& field_;
  const WallModel& wall_;
  const PhysicalSettings settings_;
  double lipschitz_;
  std::vector<double> free_mm_;  ///< a node: how far it may still move before it can touch
  int iteration_ = 1;            ///< k of the cycle
  int next_ = 0;                 ///< update within iteration k
  double sum_squared_update_ = 0;
  std::int64_t cycle_updates_ = 0;
  double last_cycle_rms_ = 0;
  std::int64_t updates_ = 0;
  std::int64_t lookups_ = 0;
};

}  // namespace torquer
