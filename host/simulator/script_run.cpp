#include "host/simulator/script_run.h"

#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host/bus/clock.h"
#include "host/simulator/session.h"
#include "host/support/csv_table.h"
#include "host/support/error.h"

namespace torquer::simulator {

namespace {

nlohmann::json Describe(const Session& session, double time_s, double solve_us) {
  const WireState& state = session.state();
  nlohmann::json nodes = nlohmann::json::array();
  for (const Eigen::Vector3d& x : state.nodes) nodes.push_back({x[0], x[1], x[2]});
  const TickReport& report = session.report();
  nlohmann::json line = {{"time_s", time_s},
                         {"insertion_mm", state.insertion_mm},
                         {"rotation_rad", state.rotation_rad},
                         {"carried_mm", report.carried_mm},
                         {"nodes_mm", std::move(nodes)},
                         {"energy_mJ", report.energy_mJ},
                         {"residual", report.residual},
                         {"max_penetration_um", 1e3 * report.max_penetration_mm},
                         {"iterations", report.iterations},
                         {"work", report.work},
                         {"solve_us", solve_us},
                         {"state_hash", std::to_string(session.state_hash())},
                         {"status", session.status()}};
  for (const effects::Reading& reading : session.Readings()) line[reading.name] = reading.value;
  return line;
}

}  // namespace

int RunScript(scene::Scene& scene, const std::string& script, const std::string& states) {
  const std::string header = "time_s,insertion_mm,rotation_rad";
  const std::vector<CsvRow> rows = ReadCsv(script, header);
  double last_s = -1e300;
  for (const CsvRow& row : rows) {
    const double time_s = CsvNumber(script, header, row, 0);
    CsvNumber(script, header, row, 1);
    CsvNumber(script, header, row, 2);
    if (!(time_s > last_s)) {
      throw UserError(script + ":" + std::to_string(row.line) + ": time_s is " + row.cells[0] +
                      ", not after the row before; let times ascend");
    }
    last_s = time_s;
  }

  const std::string unfinished = states + ".part";
  std::ofstream out(unfinished);
  if (!out) {
    throw UserError(states + ": cannot be written; check the folder and its permissions");
  }
  Session session(scene);
  const double first_s = rows.empty() ? 0 : CsvNumber(script, header, rows[0], 0);
  int unconverged = 0;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    Command command;
    command.sequence = static_cast<std::int64_t>(k);
    command.target = {scene.inserted_at_start_mm() + CsvNumber(script, header, rows[k], 1),
                      CsvNumber(script, header, rows[k], 2)};
    command.time_s = CsvNumber(script, header, rows[k], 0) - first_s;
    CountedBudget budget(scene.budget_units());
    const std::int64_t start_us = bus::MonotonicUs();
    unconverged += !session.Tick(command, budget).converged;
    const auto solve_us = static_cast<double>(bus::MonotonicUs() - start_us);
    out << Describe(session, CsvNumber(script, header, rows[k], 0), solve_us).dump() << '\n';
    if (isatty(fileno(stderr)) != 0 && (k % 64 == 0 || k + 1 == rows.size())) {
      std::fprintf(stderr, "\rrow %zu of %zu", k + 1, rows.size());
    }
  }
  if (isatty(fileno(stderr)) != 0) std::fprintf(stderr, "\n");
  out.close();
  if (!out) {
    std::filesystem::remove(unfinished);
    throw UserError(states + ": writing failed; is the disk full?");
  }
  std::filesystem::rename(unfinished, states);
  return unconverged;
}

}  // namespace torquer::simulator
