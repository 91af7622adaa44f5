#include "host/simulator/script_run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/picture_file.h"
#include "host/simulator/row_run.h"
#include "host/simulator/session_record.h"
#include "host/simulator/simulation.h"
#include "host/support/atomic_file.h"
#include "host/support/csv_table.h"
#include "host/support/error.h"
#include "host/support/nearest_name.h"

namespace torquer::simulator {

namespace {

// The same as on the bus, of every node.
void AddForces(const InternalForces& forces, nlohmann::json& line) {
  const auto in_milli = [](const std::vector<double>& values) {
    nlohmann::json all = nlohmann::json::array();
    for (const double value : values) all.push_back(1e3 * value);
    return all;
  };
  nlohmann::json contacts = nlohmann::json::array();
  for (const Eigen::Vector3d& f : forces.contact_N) {
    contacts.push_back({1e3 * f[0], 1e3 * f[1], 1e3 * f[2]});
  }
  line["contact_force_mN"] = std::move(contacts);
  line["line_load_mN_mm"] = in_milli(forces.line_load_N_mm);
  line["tension_mN"] = in_milli(forces.tension_N);
  line["bending_mN_mm"] = in_milli(forces.bending_mJ);
  line["twisting_mN_mm"] = in_milli(forces.twisting_mJ);
}

nlohmann::json Describe(Simulation& simulation, double time_s, const RowRun::Cost& cost,
                        double solve_us) {
  const WireState& state = simulation.state();
  nlohmann::json nodes = nlohmann::json::array();
  for (const Eigen::Vector3d& x : state.nodes()) nodes.push_back({x[0], x[1], x[2]});
  const TickReport& report = simulation.report();
  nlohmann::json line = {{"time_s", time_s},
                         {"nodes_mm", std::move(nodes)},
                         {"energy_mJ", report.energy_mJ},
                         {"dissipated_mJ", report.dissipated_mJ},
                         {"residual", report.residual},
                         {"solver_error_mm", simulation.SolverErrorMm()},
                         {"max_penetration_um", 1e3 * report.max_penetration_mm},
                         {"iterations", cost.iterations},
                         {"work", cost.work},
                         {"solve_us", solve_us},
                         {"state_hash", std::to_string(simulation.state_hash())},
                         {"status", simulation.status()}};
  for (int k = 0; k < state.places().size(); ++k) {
    const std::string& name = simulation.scene().instruments()[static_cast<std::size_t>(k)].name;
    line[name + ".insertion_mm"] = state.places()[k].insertion_mm;
    line[name + ".rotation_rad"] = state.places()[k].rotation_rad;
    line[name + ".carried_mm"] = report.carried[k].insertion_mm;
    line[name + ".carried_rad"] = report.carried[k].rotation_rad;
  }
  for (const effects::Reading& reading : simulation.Readings()) line[reading.name] = reading.value;
  if (simulation.forces() != nullptr) AddForces(*simulation.forces(), line);
  return line;
}

// Reads a script: a column for what changes, by name.
class ScriptReader {
 public:
  ScriptReader(const std::string& script, const scene::Scene& scene)
      : table_(ReadCsvTable(script)), scene_(scene) {
    if (!table_.Find("time_s")) {
      throw UserError(fmt::format("{}:{}: there is no column time_s; a script needs one", script,
                                  table_.header_line));
    }
    for (std::size_t column = 0; column < table_.columns.size(); ++column) TakeColumn(column);
  }

  std::vector<Command> Read() const {
    std::vector<Command> commands;
    for (const CsvRow& row : table_.rows) {
      commands.push_back(ReadRow(row));
      if (commands.size() < 2 || commands.back().time_s > commands[commands.size() - 2].time_s) {
        continue;
      }
      table_.Refuse(row, *table_.Find("time_s"), ", not after the row before; let times ascend");
    }
    return commands;
  }

 private:
  using Take = void (*)(double value, Command& command);
  struct Column {
    std::size_t index;
    int instrument;  // -1: none's
    double lowest;
    double highest;
    bool whole;
    void (*take)(int instrument, double value, Command& command);
  };

  void TakeColumn(std::size_t index) {
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

  Command ReadRow(const CsvRow& row) const {
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
    return command;
  }

  const CsvTable table_;
  const scene::Scene& scene_;
  std::vector<Column> columns_;
};

// One JSON object a row; a path of "" wants none.
class StatesFile {
 public:
  explicit StatesFile(const std::string& path) {
    if (!path.empty()) file_.emplace(path);
  }
  // A disk that has failed ends the run, since no later row can be kept.
  void Write(Simulation& simulation, double time_s, const RowRun::Cost& cost, double solve_us) {
    if (!file_) return;
    file_->out() << Describe(simulation, time_s, cost, solve_us).dump() << '\n';
    if (!file_->KeepSoFar()) file_->Finish();
  }
  void Finish() {
    if (file_) file_->Finish();
  }

 private:
  std::optional<AtomicFile> file_;
};

class PictureFolder {
 public:
  PictureFolder(const std::string& path, const Simulation& simulation) : path_(path) {
    if (path_.empty()) return;
    if (simulation.image_count() == 0) {
      throw UserError(simulation.scene().path() +
                      ": has no X-ray picture to render; add [effects.fluoroscopy]");
    }
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) throw UserError(path_ + ": cannot be made (" + error.message() + ")");
    AtomicFile{NameOf(1)};  // refused before the run, not in it
  }
  void Write(const Simulation& simulation) {
    if (path_.empty()) return;
    counts_.resize(simulation.image_count());
    for (std::size_t k = 0; k < counts_.size(); ++k) {
      if (!simulation.picture_due(k)) continue;
      simulation.image(k)->Render(picture_);
      WritePng(NameOf(++counts_[k], k), picture_);
    }
  }

 private:
  std::string NameOf(int number, std::size_t image = 0) const {
    return fmt::format("{}/{}_{:06}.png", path_, image == 0 ? "picture" : "lateral", number);
  }

  const std::string path_;
  effects::ImageSource::Picture picture_;
  std::vector<int> counts_;  // of each plane
};

void WarnOfClamping(const scene::Scene& scene, const std::vector<Command>& commands) {
  for (int k = 0; k < scene.stack().size(); ++k) {
    const double longest_mm = scene.stack().instrument(k).max_length_mm();
    double most_mm = 0;
    for (const Command& command : commands) {
      most_mm = std::max(most_mm, command.target[k].insertion_mm);
    }
    if (most_mm <= longest_mm) continue;
    fmt::print(stderr,
               "torquer-simulator: {} is commanded to {:g} mm past the entry point and is clamped "
               "to its max_length_mm, {:g}\n",
               scene.instruments()[static_cast<std::size_t>(k)].name, most_mm, longest_mm);
  }
}

}  // namespace

std::vector<Command> ReadScript(const std::string& script, const scene::Scene& scene) {
  return ScriptReader(script, scene).Read();
}

ScriptResult RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs,
                       const std::atomic<bool>& stop) {
  const std::vector<Command> commands = ReadScript(script, scene);
  WarnOfClamping(scene, commands);
  Simulation simulation(scene);
  PictureFolder pictures(outputs.pictures, simulation);
  StatesFile states(outputs.states);
  std::optional<SessionRecord> record;
  if (!outputs.record.empty()) record.emplace(outputs.record, simulation);
  const double first_s = commands.empty() ? 0 : commands.front().time_s;
  const bool terminal = isatty(fileno(stderr)) != 0;
  ScriptResult result;
  result.rows = commands.size();
  RowRun rows(simulation);
  for (std::size_t k = 0; k < commands.size() && !stop; ++k) {
    Command row = commands[k];
    row.time_s -= first_s;
    double solve_us = 0;
    std::int64_t start_us = bus::MonotonicUs();
    const auto after_tick = [&] {
      solve_us += static_cast<double>(bus::MonotonicUs() - start_us);
      pictures.Write(simulation);
      start_us = bus::MonotonicUs();
      return !stop;
    };
    // A row may be an hour of ticks; one that is left unfinished has no state.
    if (!rows.GoTo(row, after_tick)) break;
    result.unconverged += !simulation.report().converged;
    states.Write(simulation, commands[k].time_s, rows.cost(), solve_us);
    ++result.done;
    if (terminal && (k % 64 == 0 || k + 1 == commands.size())) {
      fmt::print(stderr, "\rrow {} of {}", k + 1, commands.size());
    }
  }
  if (terminal) fmt::print(stderr, "\n");
  states.Finish();
  if (record) record->Finish(simulation);
  return result;
}

}  // namespace torquer::simulator
