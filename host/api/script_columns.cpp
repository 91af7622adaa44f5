#include "host/api/script_columns.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "host/api/control_columns.h"
#include "host/simulator/command_limits.h"
#include "host/simulator/scene/device_library.h"
#include "host/simulator/simulation.h"
#include "host/support/error.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"

namespace torquer {

ScriptColumns::ScriptColumns(const CsvTable& table, std::string scene,
                             std::vector<InstrumentInfo> instruments)
    : table_(table), scene_(std::move(scene)), instruments_(std::move(instruments)) {
  if (!table_.Find("time_s")) {
    throw UserError(fmt::format("{}:{}: there is no column time_s; a script needs one", table_.path,
                                table_.header_line));
  }
  for (std::size_t column = 0; column < table_.columns.size(); ++column) TakeColumn(column);
}

void ScriptColumns::TakeColumn(std::size_t index) {
  constexpr double kAny = 1e300;
  const std::string& name = table_.columns[index];
  std::vector<std::string> known = {"time_s"};
  const auto add = [&](std::size_t instrument, double lowest, double highest, auto take) {
    columns_.push_back({index, instrument, lowest, highest, take});
  };
  if (name == "time_s") {
    return add(0, -kAny, kAny, [](std::size_t, double v, Command& row) { row.time_s = v; });
  }
  for (const ControlColumn& control : ControlColumns()) {
    if (name == control.name) {
      control_columns_.emplace_back(index, &control);
      return;
    }
    known.emplace_back(control.name);
  }
  for (std::size_t k = 0; k < instruments_.size(); ++k) {
    const std::string& instrument = instruments_[k].name;
    if (name == instrument + ".insertion_mm") {
      const double start_mm = instruments_[k].start.insertion_mm;
      return add(k, -start_mm, simulator::kPoseLimit - start_mm,
                 [](std::size_t i, double v, Command& row) { row.hands[i].insertion_mm += v; });
    }
    if (name == instrument + ".rotation_rad") {
      return add(k, -simulator::kPoseLimit, simulator::kPoseLimit,
                 [](std::size_t i, double v, Command& row) { row.hands[i].rotation_rad = v; });
    }
    if (name == instrument + ".device") {
      device_columns_.push_back({index, k, ""});
      return;
    }
    for (const char* column : {".insertion_mm", ".rotation_rad", ".device"}) {
      known.push_back(instrument + column);
    }
  }
  const std::string near = NearestName(name, known);
  throw UserError(
      fmt::format("{}:{}: a script for {} cannot have the column {}; {}known columns: {}",
                  table_.path, table_.header_line, scene_, Printable(name),
                  near.empty() ? "" : "did you mean " + near + "? ", fmt::join(known, ", ")));
}

void ScriptColumns::ReadControls(const CsvRow& row, Command& command) const {
  for (const auto& [index, control] : control_columns_) {
    const std::optional<double> value = control->words.empty()
                                            ? std::optional(table_.Number(row, index))
                                            : control->ValueOf(row.cells[index]);
    if (!value || !control->Allows(*value)) {
      table_.Refuse(row, index, "; give " + control->Values());
    }
    control->take(*value, command);
  }
}

void ScriptColumns::ReadDevices(const CsvRow& row, ScriptRow& out) {
  for (DeviceColumn& column : device_columns_) {
    const std::string& device = row.cells[column.index];
    if (device.empty() || device == column.device) continue;
    const std::vector<std::string> known = scene::DeviceNames();
    if (std::find(known.begin(), known.end(), device) == known.end()) {
      const std::string near = NearestName(device, known);
      table_.Refuse(
          row, column.index,
          fmt::format(", not a device of the library; {}there are: {}",
                      near.empty() ? "" : "did you mean " + near + "? ", fmt::join(known, ", ")));
    }
    column.device = device;
    out.exchanges.emplace_back(column.instrument, device);
  }
}

ScriptRow ScriptColumns::Read(const CsvRow& row) {
  ScriptRow out;
  out.place = fmt::format("{}:{}", table_.path, row.line);
  ReadDevices(row, out);
  Command& command = out.command;
  for (const InstrumentInfo& instrument : instruments_) command.hands.push_back(instrument.start);
  for (const Column& column : columns_) {
    const double value = table_.Number(row, column.index);
    const bool in_range = value >= column.lowest && value <= column.highest;
    if (!in_range) {
      table_.Refuse(row, column.index,
                    fmt::format("; give {:g} to {:g}", column.lowest, column.highest));
    }
    column.take(column.instrument, value, command);
  }
  ReadControls(row, command);
  if (before_s_ && command.time_s <= *before_s_) {
    table_.Refuse(row, *table_.Find("time_s"),
                  ", not later than the previous row; give increasing times");
  }
  before_s_ = command.time_s;
  if (!first_s_) first_s_ = command.time_s;
  out.time_s = command.time_s;
  command.time_s -= *first_s_;
  return out;
}

namespace {

std::vector<ScriptRow> RowsOf(const CsvTable& table, const std::string& scene,
                              const std::vector<InstrumentInfo>& instruments) {
  ScriptColumns columns(table, scene, instruments);
  std::vector<ScriptRow> rows;
  for (const CsvRow& row : table.rows) rows.push_back(columns.Read(row));
  return rows;
}

}  // namespace

std::vector<ScriptRow> ReadScript(const std::string& script, const std::string& scene,
                                  const std::vector<InstrumentInfo>& instruments) {
  return RowsOf(ReadCsvTable(script), scene, instruments);
}

std::vector<ScriptRow> ParseScript(const std::string& csv, const std::string& path,
                                   const std::string& scene,
                                   const std::vector<InstrumentInfo>& instruments) {
  return RowsOf(ParseCsvTable(csv, path), scene, instruments);
}

}  // namespace torquer
