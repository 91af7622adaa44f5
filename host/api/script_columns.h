// Reads the columns of a script.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host/api/torquer/torquer.h"
#include "host/support/csv_table.h"

namespace torquer {

/// Columns of a script by name. time_s is required and ascends. Optional columns of each instrument
/// are NAME.insertion_mm and NAME.rotation_rad, measured from the start. Others are lao_deg,
/// cra_deg, xray and contrast (0 or 1), and the table's table_left_mm, table_head_mm,
/// table_height_mm. Errors are UserError naming file, line, value and remedy.
class ScriptColumns {
 public:
  /// Reads only the header. `scene`: the name of the instruments' scene in messages. `table` must
  /// outlive this.
  ScriptColumns(const CsvTable& table, std::string scene, std::vector<InstrumentInfo> instruments);

  /// Reads the next row, which must be later than the row before.
  Command Read(const CsvRow& row);

 private:
  struct Column {
    std::size_t index;
    std::size_t instrument;  // of columns of an instrument
    double lowest;
    double highest;
    bool whole;
    void (*take)(std::size_t instrument, double value, Command& command);
  };

  void TakeColumn(std::size_t index);

  const CsvTable& table_;
  const std::string scene_;
  const std::vector<InstrumentInfo> instruments_;
  std::vector<Column> columns_;
  std::optional<double> before_s_;
};

/// Reads all rows of a script file. Throws UserError as ScriptColumns.
std::vector<Command> ReadScript(const std::string& script, const std::string& scene,
                                const std::vector<InstrumentInfo>& instruments);

}  // namespace torquer
