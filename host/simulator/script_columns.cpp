#include "host/simulator/script_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <numbers>

#include "host/support/error.h"
#include "host/support/nearest_name.h"

namespace torquer::simulator {

ScriptColumns::ScriptColumns(const CsvTable& table, const scene::Scene& scene)
    : table_(table), scene_(scene) {
  if (!table_.Find("time_s")) {
    throw UserError(fmt::format("{}:{}: there is no column time_s; a script needs one", table_.path,
                                table_.header_line));
  }
  for (std::size_t column = 0; column < table_.columns.size(); ++column) TakeColumn(column);
}

void ScriptColumns::TakeColumn(std::size_t index) {
  constexpr double kRadPerDeg = std::numbers::pi / 180;
  constexpr double kAny = 1e300;
  const std::string& name = table_.columns[index];
  std::vector<std::string> known = {"time_s", "lao_deg", "cra_deg", "xray", "contrast"};
  const auto add = [&](int instrument, double lowest, double highest, bool whole, auto take) {
    columns_.push_back({index, instrument, lowest, highest, whole, take});
  };
  if (name == "time_s") {
    return add(-1, -kAny, kAny, false, [](int, double v, Command& c) { c.time_s = v; });
  }
  if (name == "lao_deg") {
    return add(-1, -180, 180, false,
               [](int, double v, Command& c) { c.controls.lao_rad = kRadPerDeg * v; });
  }
  if (name == "cra_deg") {
    return add(-1, -180, 180, false,
               [](int, double v, Command& c) { c.controls.cra_rad = kRadPerDeg * v; });
  }
  if (name == "xray") {
    return add(-1, 0, 1, true, [](int, double v, Command& c) { c.controls.xray = v == 1; });
  }
  if (name == "contrast") {
    return add(-1, 0, 1, true, [](int, double v, Command& c) { c.controls.contrast = v == 1; });
  }
  for (std::size_t k = 0; k < scene_.instruments().size(); ++k) {
    const std::string& instrument = scene_.instruments()[k].name;
    if (name == instrument + ".insertion_mm") {
      return add(static_cast<int>(k), -kAny, kAny, false,
                 [](int i, double v, Command& c) { c.target[i].insertion_mm += v; });
    }
    if (name == instrument + ".rotation_rad") {
      return add(static_cast<int>(k), -kAny, kAny, false,
                 [](int i, double v, Command& c) { c.target[i].rotation_rad = v; });
    }
    known.push_back(instrument + ".insertion_mm");
    known.push_back(instrument + ".rotation_rad");
  }
  const std::string near = NearestName(name, known);
  throw UserError(fmt::format("{}:{}: a script of {} has no column {}; {}it may have: {}",
                              table_.path, table_.header_line, scene_.path(), name,
                              near.empty() ? "" : "did you mean " + near + "? ",
                              fmt::join(known, ", ")));
}

Command ScriptColumns::Read(const CsvRow& row) {
  Command command;
  command.target = scene_.start();
  for (const Column& column : columns_) {
    const double value = table_.Number(row, column.index);
    const bool in_range = value >= column.lowest && value <= column.highest;
    if (column.whole && value != 0 && value != 1) {
      table_.Refuse(row, column.index, "; give 0 or 1");
    }
    if (!in_range) {
      table_.Refuse(row, column.index,
                    fmt::format("; give {:g} to {:g}", column.lowest, column.highest));
    }
    column.take(column.instrument, value, command);
  }
  if (before_s_ && command.time_s <= *before_s_) {
    table_.Refuse(row, *table_.Find("time_s"), ", not after the row before; let times ascend");
  }
  before_s_ = command.time_s;
  return command;
}

std::vector<Command> ReadScript(const std::string& script, const scene::Scene& scene) {
  const CsvTable table = ReadCsvTable(script);
  ScriptColumns columns(table, scene);
  std::vector<Command> commands;
  for (const CsvRow& row : table.rows) commands.push_back(columns.Read(row));
  return commands;
}

}  // namespace torquer::simulator
