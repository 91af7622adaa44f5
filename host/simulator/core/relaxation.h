// What every relaxation promises, and the tick that all of them share.
//
// A tick reads: move a part of the way -> relax -> .. -> at rest, until every instrument is where
// its hand wants it and the wire is in balance, or the budget is spent. A method says how it moves
// and how it relaxes; when to do which is decided here, once.
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "host/simulator/core/instrument_place.h"
#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Decides when a tick has to end. The core knows no clock: real time gives a deadline here, a
/// replay the number of units that were recorded.
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
  bool converged = false;     ///< relaxed, with a residual within the tolerance
  bool budget_spent = false;  ///< ended by the budget: motion is carried or the wire not at rest
  bool stalled = false;       ///< ended out of balance: no step that was tried came nearer to it
  bool snapped = false;       ///< the tip went much farther than the hands
  /// For each instrument what was asked for and is not yet done, positive where the hand is ahead.
  /// Insertions count as asked for within 0 .. the instrument's length.
  InstrumentPlaces carried;
  double energy_mJ = 0;      ///< of bending, wall and effects, without what is dissipated
  double dissipated_mJ = 0;  ///< of terms with EnergyTerm::Dissipates
  double residual = 0;       ///< largest out-of-balance moment over the local EI/(1 mm)
  double max_penetration_mm = 0;

  /// What relaxing decreases while the hands rest.
  double relaxed_mJ() const { return energy_mJ + dissipated_mJ; }
  /// Whether no instrument has motion left.
  bool arrived() const { return carried == InstrumentPlaces(carried.size()); }
};

/// One attempt of a method to improve the wire, for those who tune it. See Relaxation::Record.
struct AttemptRecord {
  double residual = 0;        ///< before it
  double energy_mJ = 0;       ///< before it
  double weight = 0;          ///< damping weight, in units of the local EI/(1 mm)
  double step_scale = 0;      ///< part of the model's step that was tried; 0: none
  double expected_mJ = 0;     ///< decrease of the energy that the model predicts
  double gained_mJ = 0;       ///< decrease that was found
  int active_set_rounds = 0;  ///< solutions of the model
  std::int64_t lookups = 0;   ///< of the vessel's field, in this attempt
  bool accepted = false;
};

/// A way to bring the instruments to where the hands want them and to relax them there.
///
/// Whatever happens, the state stays finite, its tangents unit and its lengths exact; what could
/// not be reached is said in the report and continued by the next tick. The same state, targets and
/// numbers of units give the same bits.
class Relaxation {
 public:
  Relaxation(const Relaxation&) = delete;
  Relaxation& operator=(const Relaxation&) = delete;
  virtual ~Relaxation() = default;

  /// One tick: moves towards `target` (finite, one place for each instrument) and relaxes, as far
  /// as `budget` allows.
  TickReport Tick(const InstrumentPlaces& target, WorkBudget& budget, WireState& state);
  /// To be called after the state was replaced from outside (laid along a path, restored).
  virtual void Restart(WireState& state) = 0;
  /// The expansion at the state that the last Tick or Restart left: contacts, gradient.
  virtual const Expansion& Current() const = 0;
  /// About how far a node of the state that the last Tick or Restart left is from where relaxing to
  /// the end would bring it, mm: the largest displacement of the next step of Newton's method. NaN
  /// where the method does not know, and where the state is near no minimum. Costs about a third of
  /// an iteration, and changes nothing.
  virtual double SolverErrorMm(const WireState& state) {
    static_cast<void>(state);
    return std::numeric_limits<double>::quiet_NaN();
  }
  /// About how far a node of the state that the last Tick or Restart left is from where it would
  /// be with ever finer segments, mm: the largest displacement, to leading order
  /// in the segment (README section 19). NaN where the method does not know: where the wire
  /// touches the wall, of wires that twist, with terms that remember the way
  /// (EnergyTerm::Dissipates), and where the state is near no minimum. Costs about half an
  /// iteration, and changes nothing.
  virtual double DiscretizationErrorMm(const WireState& state) {
    static_cast<void>(state);
    return std::numeric_limits<double>::quiet_NaN();
  }
  /// Goes on from where `twin` stands, a relaxation of the same method in the same scene. `state`
  /// is a copy of the twin's; what energy terms remember is not copied here.
  virtual void CopyFrom(const Relaxation& twin, const WireState& state) = 0;
  /// Mixes all that the method and its energy terms remember into a hash of the state.
  virtual std::uint64_t Hash(std::uint64_t seed) const { return seed; }
  /// Appends a record of every attempt from now on; null: none. Without, nothing is gathered.
  void Record(std::vector<AttemptRecord>* records) { records_ = records; }

  const InstrumentStack& stack() const { return stack_; }

 protected:
  /// A lone wire; must outlive this.
  explicit Relaxation(const WireModel& wire) : lone_(std::in_place, wire), stack_(*lone_) {}
  /// A stack; must outlive this, and is moved by it.
  explicit Relaxation(InstrumentStack& stack) : stack_(stack) {}

  InstrumentStack& stack() { return stack_; }
  std::vector<AttemptRecord>* records() const { return records_; }

 private:
  // How a method does it. `goal`: the target within what the instruments can.

  /// Whether no motion is left that the method could carry out.
  virtual bool Arrived(const InstrumentPlaces& goal, const WireState& state) const = 0;
  /// Before anything else.
  virtual void Begin(WireState& state) = 0;
  /// Whether the next part of the motion may come now; it always may where the wire is at rest.
  virtual bool MayMove() const = 0;
  /// Moves a part of the way. Returns the number of actions.
  virtual int Move(const InstrumentPlaces& goal, WireState& state) = 0;
  /// Whether relaxing has come to its end at this state: in balance, or stalled.
  virtual bool AtRest(WireState& state) = 0;
  /// One unit of relaxing.
  virtual void Relax(WireState& state, TickReport& report) = 0;
  /// After all; `settled`: all instruments have arrived, and relaxing has come to its end.
  /// Current() must be that of the state from here on.
  virtual void End(const WireState& state, bool settled, TickReport& report) = 0;

  std::optional<InstrumentStack> lone_;
  InstrumentStack& stack_;
  std::vector<AttemptRecord>* records_ = nullptr;
};

}  // namespace torquer
