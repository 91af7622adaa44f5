// Reads the columns of a script.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "host/api/control_columns.h"
#include "host/api/torquer/torquer.h"
#include "host/support/csv_table.h"

namespace torquer {

/// Columns of a script by name. time_s is required and ascends. Optional columns of each instrument
/// are NAME.insertion_mm and NAME.rotation_rad, measured from the start, and NAME.device. A device
/// stays until a row names another one; an empty cell names none. Others are
/// ControlColumns(). Errors are UserError naming file, line, value and remedy.
class ScriptColumns {
 public:
  /// Reads only the header. `scene`: the name of the instruments' scene in messages. `table` must
  /// outlive this.
  ScriptColumns(const CsvTable& table, std::string scene, std::vector<InstrumentInfo> instruments);

  /// Reads the next row, which must be later than the row before.
  ScriptRow Read(const CsvRow& row);

 private:
  struct Column {
    std::size_t index;
    std::size_t instrument;  // of columns of an instrument
    double lowest;
    double highest;
    void (*take)(std::size_t instrument, double value, Command& command);
  };

  // Column of device names of an instrument.
  struct DeviceColumn {
    std::size_t index;
    std::size_t instrument;
    std::string device;  // newest one; "" before the first
  };

  void TakeColumn(std::size_t index);
  void ReadDevices(const CsvRow& row, ScriptRow& out);
  void ReadControls(const CsvRow& row, Command& command) const;

  const CsvTable& table_;
  const std::string scene_;
  const std::vector<InstrumentInfo> instruments_;
  std::vector<Column> columns_;
  std::vector<DeviceColumn> device_columns_;
  std::vector<std::pair<std::size_t, const ControlColumn*>> control_columns_;
  std::optional<double> first_s_;
  std::optional<double> before_s_;
};

/// Reads all rows of a script file. Throws UserError as ScriptColumns.
std::vector<ScriptRow> ReadScript(const std::string& script, const std::string& scene,
                                  const std::vector<InstrumentInfo>& instruments);
/// Reads all rows of a script's text; `path` names it in errors.
std::vector<ScriptRow> ParseScript(const std::string& csv, const std::string& path,
                                   const std::string& scene,
                                   const std::vector<InstrumentInfo>& instruments);

}  // namespace torquer
