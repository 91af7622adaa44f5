// Physical Relaxation: the segment updates of Baier et al. 2016, section 3.1.
//
// The paper's segment i = 1 .. n is segment i - 1 here; its joint i is joint i here. Equation
// numbers are the paper's. Rest shape: joint i bends about r, the rest direction of its distal
// segment. So the paper's omega_{i+1} / lambda is r_{i+1} - u_i. As in eq. (5a) and (5b), its
// turning with u_i enters no force. An update of segment i turns the rest directions of all distal
// joints. They are fixed to normals that are carried along the wire without twist.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Rule for the step of a segment as a function of its force: accuracy against time, in the paper's
/// order.
enum class UpdateRule {
  kSigned,     ///< (16): diverges where rho - u.B is negative
  kRhoOnly,    ///< (17)
  kAbsolute,   ///< (19): the paper's choice
  kExactRoot,  ///< root of the equation before (19)
};

struct PhysicalSettings {
  UpdateRule rule = UpdateRule::kAbsolute;
  double max_update = 0.1;  ///< du_max of (18); infinity: unbounded, as in the paper's predecessor
  int margin = 5;  ///< segments past the tip that a Tip Relaxation updates fully, and the stride of
                   ///< its single updates; use more for a very stiff wire
  /// Fraction of a cycle's n iterations that are done, from the first one on, in (0, 1]. A value
  /// below 1 makes incomplete cycles, which leave the proximal end unchanged.
  double cycle_fraction = 1;
  /// Skip look-ups of nodes that provably cannot touch. Updates stay bit-identical.
  bool skip_lookups = true;
};

/// Updates single segments, and combines the updates to Tip Relaxations and cycles.
class PhysicalRelaxation {
 public:
  PhysicalRelaxation(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                     const PhysicalSettings& settings);

  /// Call it whenever anything but this object changed the state.
  void Restart(WireState& state);

  /// Continues from the state of `twin`.
  void CopyFrom(const PhysicalRelaxation& twin);

  /// PhysicalUpdate (3.1.4) of `segment`. Returns |du|.
  double Update(int segment, WireState& state);

  /// m = M + margin, at most n.
  int TipIterations(const WireState& state) const;
  /// Tip Relaxation (3.1): the first m iterations of a cycle. Then come single updates of every
  /// margin-th segment to the proximal end.
  void RelaxTip(WireState& state);

  /// Performs at most `updates` more updates of a cycle; returns true when the cycle has ended.
  /// Iteration k = 1 .. n of a cycle updates the last k segments, distal first.
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
  std::vector<double> free_mm_;  ///< per node: distance that it can still move before it can touch
  int iteration_ = 1;            ///< k of the cycle
  int next_ = 0;                 ///< update within iteration k
  double sum_squared_update_ = 0;
  std::int64_t cycle_updates_ = 0;
  double last_cycle_rms_ = 0;
  std::int64_t updates_ = 0;
  std::int64_t lookups_ = 0;
};

}  // namespace torquer
