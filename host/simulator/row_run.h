// A motion, row by row: what a script and a program that steps have in common.
#pragma once

#include <cstdint>
#include <functional>

#include "host/simulator/simulation.h"

namespace torquer::simulator {

/// Carries out rows one after another, each in the ticks that ScriptTicks cuts it into, with the
/// budget that the scene gives a script's tick.
class RowRun {
 public:
  /// `simulation` is at its start, and must outlive this.
  explicit RowRun(Simulation& simulation);

  /// What the ticks of the last row took in all.
  struct Cost {
    int ticks = 0;
    int iterations = 0;
    int work = 0;
    bool snapped = false;  ///< in one of them
  };

  /// Goes on to `row`, whose time is after that of the row before, and has its instruments.
  /// `after_tick` is called after every tick and says whether to go on. False where it did not:
  /// the row is left unfinished then, and no other may follow.
  bool GoTo(const Command& row, const std::function<bool()>& after_tick);
  const Cost& cost() const { return cost_; }
  /// Goes on from the row at which `twin` is.
  void CopyFrom(const RowRun& twin) { before_ = twin.before_; }
  /// To be called after the simulation was restarted.
  void Restart();

 private:
  Simulation& simulation_;
  Command before_;
  Cost cost_;
};

}  // namespace torquer::simulator
