#include "host/simulator/script_run.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/picture_file.h"
#include "host/simulator/session.h"
#include "host/simulator/session_record.h"
#include "host/simulator/whole_file.h"
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
                         {"insertion_mm", session.wire_insertion_mm()},
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
  if (const CoaxialPair* const coaxial = session.scene().coaxial()) {
    line["catheter_insertion_mm"] =
        std::min(coaxial->catheter_place().insertion_mm, state.insertion_mm);
    line["catheter_rotation_rad"] = coaxial->catheter_place().rotation_rad;
  }
  for (const effects::Reading& reading : session.Readings()) line[reading.name] = reading.value;
  return line;
}

constexpr char kHandColumns[] = "time_s,insertion_mm,rotation_rad";
constexpr char kArmColumns[] = ",lao_deg,cra_deg,xray,contrast";
constexpr char kCatheterColumns[] = ",catheter_insertion_mm,catheter_rotation_rad";

// What a script has beside the columns of the hand: its first line names it.
struct Columns {
  bool arm = false;
  bool catheter = false;

  std::string Header() const {
    return std::string(kHandColumns) + (arm ? kArmColumns : "") +
           (catheter ? kCatheterColumns : "");
  }
};

Columns ColumnsOf(const std::string& script) {
  std::ifstream in(script);
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    return {.arm = line.find("lao_deg") != std::string::npos,
            .catheter = line.find("catheter_") != std::string::npos};
  }
  return {};
}

std::vector<Command> ReadScript(const std::string& script, const scene::Scene& scene) {
  const Columns columns = ColumnsOf(script);
  if (columns.catheter && scene.coaxial() == nullptr) {
    throw UserError(script + ": moves a catheter, but " + scene.path() +
                    " has none; add [effects.catheter] or leave out its columns");
  }
  const std::string header = columns.Header();
  const HandTarget start = scene.start();
  const std::vector<CsvRow> rows = ReadCsv(script, header);
  std::vector<Command> commands;
  for (const CsvRow& row : rows) {
    const auto refuse = [&](const std::string& column, std::size_t cell, const char* problem) {
      throw UserError(script + ":" + std::to_string(row.line) + ": " + column + " is " +
                      row.cells[cell] + problem);
    };
    const auto number = [&](std::size_t column) { return CsvNumber(script, header, row, column); };
    Command command;
    command.sequence = static_cast<std::int64_t>(commands.size());
    command.time_s = number(0);
    command.target = start;
    command.target.insertion_mm += number(1);
    command.target.rotation_rad = number(2);
    if (columns.catheter) {
      const std::size_t at = columns.arm ? 7 : 3;
      command.target.catheter_insertion_mm += number(at);
      command.target.catheter_rotation_rad = number(at + 1);
    }
    if (!commands.empty() && !(command.time_s > commands.back().time_s)) {
      refuse("time_s", 0, ", not after the row before; let times ascend");
    }
    if (columns.arm) {
      constexpr double kRadPerDeg = std::numbers::pi / 180;
      const double angles[] = {number(3), number(4)};
      for (std::size_t k = 0; k < 2; ++k) {
        if (std::abs(angles[k]) <= 180) continue;
        refuse(k == 0 ? "lao_deg" : "cra_deg", 3 + k, "; give -180 to 180");
      }
      for (const std::size_t column : {std::size_t{5}, std::size_t{6}}) {
        if (number(column) == 0 || number(column) == 1) continue;
        refuse(column == 5 ? "xray" : "contrast", column, "; give 0 or 1");
      }
      command.controls = {kRadPerDeg * angles[0], kRadPerDeg * angles[1], number(5) == 1,
                          number(6) == 1};
    }
    commands.push_back(command);
  }
  return commands;
}

// One JSON object a row; a path of "" wants none.
class StatesFile {
 public:
  explicit StatesFile(const std::string& path) {
    if (!path.empty()) file_.emplace(path);
  }
  void Write(const Session& session, double time_s, double solve_us) {
    if (file_) file_->out() << Describe(session, time_s, solve_us).dump() << '\n';
  }
  void Finish() {
    if (file_) file_->Finish();
  }

 private:
  std::optional<WholeFile> file_;
};

class PictureFolder {
 public:
  PictureFolder(const std::string& path, const Session& session) : path_(path) {
    if (path_.empty()) return;
    if (session.image() == nullptr) {
      throw UserError(session.scene().path() +
                      ": has no X-ray picture to render; add [effects.fluoroscopy]");
    }
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) throw UserError(path_ + ": cannot be made (" + error.message() + ")");
  }
  void Write(const Session& session) {
    if (path_.empty() || !session.picture_due()) return;
    session.image()->Render(picture_);
    char name[32];
    std::snprintf(name, sizeof name, "/picture_%06d.png", ++count_);
    WritePng(path_ + name, picture_);
  }

 private:
  const std::string path_;
  effects::ImageSource::Picture picture_;
  int count_ = 0;
};

}  // namespace

int RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs) {
  const std::vector<Command> commands = ReadScript(script, scene);
  Session session(scene);
  PictureFolder pictures(outputs.pictures, session);
  StatesFile states(outputs.states);
  std::optional<SessionRecord> record;
  if (!outputs.record.empty()) record.emplace(outputs.record, session);
  const double first_s = commands.empty() ? 0 : commands.front().time_s;
  int unconverged = 0;
  for (std::size_t k = 0; k < commands.size(); ++k) {
    Command command = commands[k];
    command.time_s -= first_s;
    CountedBudget budget(scene.budget_units());
    const std::int64_t start_us = bus::MonotonicUs();
    unconverged += !session.Tick(command, budget).converged;
    const auto solve_us = static_cast<double>(bus::MonotonicUs() - start_us);
    states.Write(session, commands[k].time_s, solve_us);
    pictures.Write(session);
    if (isatty(fileno(stderr)) != 0 && (k % 64 == 0 || k + 1 == commands.size())) {
      std::fprintf(stderr, "\rrow %zu of %zu", k + 1, commands.size());
    }
  }
  if (isatty(fileno(stderr)) != 0) std::fprintf(stderr, "\n");
  states.Finish();
  if (record) record->Finish(session);
  return unconverged;
}

}  // namespace torquer::simulator
