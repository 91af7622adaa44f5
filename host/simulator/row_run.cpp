#include "host/simulator/row_run.h"

#include "host/simulator/script_ticks.h"

namespace torquer::simulator {

RowRun::RowRun(Simulation& simulation) : simulation_(simulation) { Restart(); }

void RowRun::Restart() {
  before_ = Command();
  before_.target = simulation_.scene().start();
  before_.time_s = 0;
}

bool RowRun::GoTo(const Command& row, const std::function<bool()>& after_tick) {
  cost_ = {};
  ScriptTicks ticks(before_, row, simulation_.longest_tick_s());
  for (Command tick; ticks.Next(tick);) {
    CountedBudget budget(simulation_.scene().budget_units());
    const TickReport& report = simulation_.Tick(tick, budget);
    ++cost_.ticks;
    cost_.iterations += report.iterations;
    cost_.work += report.work;
    cost_.snapped = cost_.snapped || report.snapped;
    if (!after_tick() && !ticks.done()) return false;
  }
  before_ = row;
  return true;
}

}  // namespace torquer::simulator
