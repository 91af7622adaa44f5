// Relaxation: the interface of all methods, and the tick that they share.
//
// A tick repeats: move a part of the way, then relax. It ends when every instrument has reached its
// target in equilibrium, or when the budget is spent. A method defines how to move and how to
// relax; the shared tick decides when.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/stack/combined_rods.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

class PartFollower;

/// Work budget: decides when a tick has to end. The core has no clock. Real time implements it by a
/// deadline, a replay by the recorded number of units.
class WorkBudget {
 public:
  WorkBudget() = default;
  WorkBudget(const WorkBudget&) = delete;
  WorkBudget& operator=(const WorkBudget&) = delete;
  virtual ~WorkBudget() = default;
  /// True if another unit of work may follow the `done` units of this tick. Asked once before each
  /// unit; a granted unit is always carried out. So granting the same number again repeats a tick.
  virtual bool Allows(int done) = 0;
};

/// A budget of a fixed number of units.
class CountedBudget final : public WorkBudget {
 public:
  explicit CountedBudget(int units) : units_(units) {}
  bool Allows(int done) override { return done < units_; }

 private:
  int units_;
};

/// Report of a tick.
struct TickReport {
  int actions = 0;            ///< feeds, retractions and rotations carried out
  int work = 0;               ///< units of work granted: actions and iterations
  int iterations = 0;         ///< Newton iterations, or slices of the paper's cycles
  std::int64_t updates = 0;   ///< segment updates done
  bool converged = false;     ///< residual within the tolerance after relaxing
  bool budget_spent = false;  ///< ended by the budget: motion remains or the wire is not at rest
  bool stalled = false;  ///< ended out of equilibrium: no step that was tried came closer to it
  bool snapped = false;  ///< the tip of a curve moved much farther than the hands
  /// Remaining motion of each instrument, positive if the hand is ahead. Insertion targets are
  /// limited to 0 .. the instrument's length, and to an outlet where the instrument is held.
  InstrumentPoses carried;
  double energy_mJ = 0;      ///< Relaxation::EnergyMJ: bending, wall and effects
  double dissipated_mJ = 0;  ///< of terms with EnergyTerm::Dissipates
  double residual = 0;       ///< largest out-of-balance moment over the local EI/(1 mm)
  double max_penetration_mm = 0;

  /// Quantity that relaxing decreases while the hands rest, mJ.
  double relaxed_mJ() const { return energy_mJ + dissipated_mJ; }
  /// True if no instrument has motion left.
  bool arrived() const { return carried == InstrumentPoses(carried.size()); }
};

/// Motion from one place of the instruments to another. Both have the same number.
InstrumentPoses MotionLeft(const InstrumentPoses& goal, const InstrumentPoses& here);

/// Record of one attempt of a method to improve the wire, for tuning. See Relaxation::Record.
struct AttemptRecord {
  double residual = 0;        ///< before it
  double energy_mJ = 0;       ///< before it
  double weight = 0;          ///< damping weight, in units of the local EI/(1 mm)
  double step_scale = 0;      ///< fraction of the model's step that was tried; 0: no step
  double expected_mJ = 0;     ///< energy decrease that the model predicts
  double gained_mJ = 0;       ///< energy decrease that was measured
  int active_set_rounds = 0;  ///< solutions of the model
  std::int64_t lookups = 0;   ///< of the vessel's field, in this attempt
  bool definite = false;      ///< Hessian of the last of these is positive definite
  bool accepted = false;
};

/// Relaxation method: brings the instruments to their targets and relaxes them there.
///
/// The state always stays finite, with unit tangents and exact lengths. The report states the
/// motion that remains, and the next tick continues it. The same state, targets and numbers of
/// units give the same bits.
class Relaxation {
 public:
  Relaxation(const Relaxation&) = delete;
  Relaxation& operator=(const Relaxation&) = delete;
  virtual ~Relaxation() = default;

  /// One tick: moves towards `target` (finite, one pose for each instrument) and relaxes, as far
  /// as `budget` allows.
  TickReport Tick(const InstrumentPoses& target, WorkBudget& budget, WireState& state);
  /// Call it after the state was replaced from outside (laid along a path, restored).
  virtual void Restart(WireState& state) = 0;
  /// Quadratic model at the state after the last Tick or Restart: contacts, gradient.
  virtual const QuadraticModel& Current() const = 0;
  /// Energy of bending, wall and terms at that state, without the dissipated part, mJ. It includes
  /// the energy of a stack that acts on no shape (README (38)), which the quadratic model omits.
  double EnergyMJ(const WireState& state) const;
  /// Estimated distance of a node from its fully relaxed position, mm, after the last Tick or
  /// Restart. It is the largest displacement of the next Newton step. NaN if the method cannot
  /// estimate it, or if the state is near no minimum. Costs about a third of an iteration; does not
  /// change the state.
  virtual double SolverErrorMm(const WireState& state) {
    static_cast<void>(state);
    return std::numeric_limits<double>::quiet_NaN();
  }
  /// Estimated distance of a node from its position with ever finer segments, mm, after the last
  /// Tick or Restart. It is the largest displacement, to leading order in the segment length
  /// (README section 19). NaN if the method cannot estimate it. This is the case if the wire
  /// touches the wall or twists, or if the state is near no minimum. It is also the case if a term
  /// remembers the path (EnergyTerm::Dissipates). Costs about half an iteration; does not change
  /// the state.
  virtual double DiscretizationErrorMm(const WireState& state) {
    static_cast<void>(state);
    return std::numeric_limits<double>::quiet_NaN();
  }
  /// Continues from the state of `twin`, a relaxation of the same method in the same scene. `state`
  /// is a copy of the twin's. The memory of energy terms is not copied here.
  virtual void CopyFrom(const Relaxation& twin, const WireState& state) = 0;
  /// Mixes the memory of the method and its energy terms into a hash of the state.
  virtual std::uint64_t Hash(std::uint64_t seed) const { return seed; }
  /// Appends a record of every attempt from now on; null stops recording, at no cost.
  void Record(std::vector<AttemptRecord>* records) { records_ = records; }
  /// `follower` sees each part of the motion from the next Restart on; null: none, at no cost. Only
  /// Newton's method has followers, and only for one curve that does not touch itself.
  void Follow(PartFollower* follower) { follower_ = follower; }

  const InstrumentStack& stack() const { return rods_.stack(); }
  /// Rods of the curves at the present poses.
  const CombinedRods& rods() const { return rods_; }

 protected:
  /// A lone wire, which must outlive this.
  explicit Relaxation(const WireModel& wire) : lone_(std::in_place, wire), rods_(*lone_) {}
  /// A stack, which must outlive this.
  explicit Relaxation(const InstrumentStack& stack) : rods_(stack) {}

  /// Sets the rods to the instruments at `poses`.
  void Combine(const InstrumentPoses& poses) { rods_.Combine(poses); }
  std::vector<AttemptRecord>* records() const { return records_; }
  PartFollower* follower() const { return follower_; }

 private:
  // Steps of a method. `goal`: the target within the instruments' limits.

  /// True if no motion is left that the method could carry out.
  virtual bool Arrived(const InstrumentPoses& goal, const WireState& state) const = 0;
  /// Called first in every tick.
  virtual void Begin(WireState& state) = 0;
  /// True if the next part of the motion may start now. If the wire is at rest it may always start.
  virtual bool MayMove() const = 0;
  /// Moves a part of the way. Returns the number of actions.
  virtual int Move(const InstrumentPoses& goal, WireState& state) = 0;
  /// True if relaxing has ended at this state: in equilibrium, or stalled.
  virtual bool AtRest(WireState& state) = 0;
  /// Performs one unit of relaxing.
  virtual void Relax(WireState& state, TickReport& report) = 0;
  /// Called last. `settled`: all instruments have arrived, and relaxing has ended. From here on
  /// Current() must belong to the state; Tick takes the energy from it.
  virtual void End(const WireState& state, bool settled, TickReport& report) = 0;

  std::optional<InstrumentStack> lone_;
  CombinedRods rods_;
  std::vector<AttemptRecord>* records_ = nullptr;
  PartFollower* follower_ = nullptr;
};

}  // namespace torquer
