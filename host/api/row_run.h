// Runs a motion row by row, for scripts and for programs that step.
#pragma once

#include <functional>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"

namespace torquer {

/// Public descriptions of a scene's instruments, the innermost first.
std::vector<InstrumentInfo> InstrumentsOf(const scene::Scene& scene);

/// Converts settings of the X-ray system to the type that effects take, and back.
effects::Imaging ToEffects(const Imaging& imaging);
Imaging FromEffects(const effects::Imaging& imaging);
/// The same for the power injector, for the table, and for the controls of a command.
effects::Injector ToEffects(const Injector& injector);
Injector FromEffects(const effects::Injector& injector);
effects::Table ToEffects(const Table& table);
Table FromEffects(const effects::Table& table);
effects::Controls ToControls(const Command& row);

/// Runs rows one after another. ScriptTicks divides each row into ticks, each with the scene's
/// budget for a script's tick.
class RowRun {
 public:
  /// `simulation` must be at its start, and must outlive this.
  explicit RowRun(simulator::Simulation& simulation);

  /// Advances to `row`, as Simulation::Step of torquer.h. `row` must be later than the row before,
  /// and have the same instruments.
  StepReport GoTo(const Command& row,
                  const std::function<bool(const StepReport& tick)>& after_tick);
  /// Command of the last tick; before the first one, the start.
  const Command& command() const { return command_; }
  /// True if a tick has run since the start.
  bool begun() const { return begun_; }
  /// Copies the state of `twin`.
  void CopyFrom(const RowRun& twin);
  /// Call it after a restart of the simulation.
  void Restart();
  /// Continues with another simulation of the same instruments, in the same state.
  void ContinueIn(simulator::Simulation& simulation) { simulation_ = &simulation; }

 private:
  // Longest tick on the way to `row`.
  double LongestTickTo(const Command& row) const;

  simulator::Simulation* simulation_;
  Command command_;
  bool begun_ = false;
};

}  // namespace torquer
