// What every relaxation promises: the contract between a method and those who run it.
#pragma once

#include <cstdint>
#include <vector>

#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Where the hand wants the wire, and the catheter around it if there is one: absolute, since the
/// start.
struct HandTarget {
  double insertion_mm = 0;
  double rotation_rad = 0;
  double catheter_insertion_mm = 0;
  double catheter_rotation_rad = 0;
};

/// Decides when a tick has to end. The core knows no clock: real time gives a deadline here, a
/// replay the number of steps that were recorded.
class WorkBudget {
 public:
  WorkBudget() = default;
  WorkBudget(const WorkBudget&) = delete;
  WorkBudget& operator=(const WorkBudget&) = delete;
  virtual ~WorkBudget() = default;
  /// May another unit of work follow the `done` units of this tick? Asked once before each; a unit
  /// that was granted is done. So granting the same number again repeats a tick.
  virtual bool Allows(int done) = 0;
};

/// A budget of a number of units.
class CountedBudget final : public WorkBudget {
 public:
  explicit CountedBudget(int units) : units_(units) {}
  bool Allows(int done) override { return done < units_; }

 private:
  int units_;
};

/// How a tick went.
struct TickReport {
  int actions = 0;            ///< feeds, retractions and rotations carried out
  int work = 0;               ///< units of work granted: actions and iterations
  int iterations = 0;         ///< Newton iterations, or slices of the paper's cycles
  std::int64_t updates = 0;   ///< segment updates done
  bool converged = false;     ///< residual within the tolerance
  bool budget_spent = false;  ///< ended by the budget: carried motion or residual is left
  bool snapped = false;       ///< the tip went much farther than the hand
  double carried_mm = 0;      ///< asked for and not yet fed
  double energy_mJ = 0;
  double residual = 0;  ///< largest out-of-balance moment over the local EI/(1 mm)
  double max_penetration_mm = 0;
};

/// Asks `budget` for one more unit, and counts it in `report` when it is granted.
inline bool Grant(WorkBudget& budget, TickReport& report) {
  if (!budget.Allows(report.work)) return false;
  ++report.work;
  return true;
}

/// A way to bring the wire to where the hand wants it and to relax it there.
///
/// Whatever happens, the state stays finite, its tangents unit and its lengths exact; what could
/// not be reached is said in the report and continued by the next tick. The same state, target and
/// number of units give the same bits.
class Relaxation {
 public:
  Relaxation() = default;
  Relaxation(const Relaxation&) = delete;
  Relaxation& operator=(const Relaxation&) = delete;
  virtual ~Relaxation() = default;

  /// One tick: moves towards `target` (finite) and relaxes, as far as `budget` allows.
  virtual TickReport Tick(const HandTarget& target, WorkBudget& budget, WireState& state) = 0;
  /// To be called after the state was replaced from outside (laid along a path, restored).
  virtual void Restart(WireState& state) = 0;
  /// The expansion at the state that the last Tick or Restart left: contacts, gradient.
  virtual const Expansion& Current() const = 0;
};

}  // namespace torquer
