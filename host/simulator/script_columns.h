// What the columns of a script mean.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/simulation.h"
#include "host/support/csv_table.h"

namespace torquer::simulator {

/// The columns of a script, by name: time_s, ascending, and any of NAME.insertion_mm and
/// NAME.rotation_rad of each instrument, absolute since the start, lao_deg, cra_deg, xray and
/// contrast (0 or 1). Errors are UserError naming file, line, value and remedy.
class ScriptColumns {
 public:
  /// Looks at the header alone. Both must outlive this.
  ScriptColumns(const CsvTable& table, const scene::Scene& scene);

  /// The next row; it is after the row before.
  Command Read(const CsvRow& row);

 private:
  struct Column {
    std::size_t index;
    int instrument;  // -1: none's
    double lowest;
    double highest;
    bool whole;
    void (*take)(int instrument, double value, Command& command);
  };

  void TakeColumn(std::size_t index);

  const CsvTable& table_;
  const scene::Scene& scene_;
  std::vector<Column> columns_;
  std::optional<double> before_s_;
};

/// The rows of a script file.
std::vector<Command> ReadScript(const std::string& script, const scene::Scene& scene);

}  // namespace torquer::simulator
