// What the columns of a script mean.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/support/csv_table.h"

namespace torquer::simulator {

/// The columns of a script, by name: time_s, ascending, and any of NAME.insertion_mm and
/// NAME.rotation_rad of each instrument, absolute since the start, lao_deg, cra_deg, xray and
/// contrast (0 or 1). Errors are UserError naming file, line, value and remedy.
class ScriptColumns {
 public:
  /// Looks at the header alone. `scene`: what messages call the scene that has these instruments.
  /// `table` must outlive this.
  ScriptColumns(const CsvTable& table, std::string scene, std::vector<InstrumentInfo> instruments);

  /// The next row; it is after the row before.
  torquer::Command Read(const CsvRow& row);

 private:
  struct Column {
    std::size_t index;
    std::size_t instrument;  // of those that have one
    double lowest;
    double highest;
    bool whole;
    void (*take)(std::size_t instrument, double value, torquer::Command& command);
  };

  void TakeColumn(std::size_t index);

  const CsvTable& table_;
  const std::string scene_;
  const std::vector<InstrumentInfo> instruments_;
  std::vector<Column> columns_;
  std::optional<double> before_s_;
};

/// The rows of a script file.
std::vector<torquer::Command> ReadScript(const std::string& script, const std::string& scene,
                                         const std::vector<InstrumentInfo>& instruments);

}  // namespace torquer::simulator
