// A motion, row by row: what a script and a program that steps have in common.
#pragma once

#include <functional>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// What a scene's instruments are to who moves them; the innermost first.
std::vector<InstrumentInfo> InstrumentsOf(const scene::Scene& scene);

/// What is chosen on the X-ray system, as effects take it.
effects::Imaging ToEffects(const Imaging& imaging);

/// Carries out rows one after another, each in the ticks that ScriptTicks cuts it into, with the
/// budget that the scene gives a script's tick.
class RowRun {
 public:
  /// `simulation` is at its start, and must outlive this.
  explicit RowRun(Simulation& simulation);

  /// As Simulation::Step of torquer.h: goes on to `row`, whose time is after that of the row
  /// before, and has its instruments.
  StepReport GoTo(const torquer::Command& row,
                  const std::function<bool(const StepReport& tick)>& after_tick);
  /// Where that has come.
  const torquer::Command& command() const { return command_; }
  /// Whether it has gone anywhere since the start.
  bool begun() const { return begun_; }
  /// Goes on from where `twin` is.
  void CopyFrom(const RowRun& twin);
  /// To be called after the simulation was restarted.
  void Restart();

 private:
  Simulation& simulation_;
  torquer::Command command_;
  bool begun_ = false;
};

}  // namespace torquer::simulator
