#include "host/simulator/script_run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include "host/bus/clock.h"
#include "host/simulator/picture_file.h"
#include "host/simulator/row_run.h"
#include "host/simulator/script_columns.h"
#include "host/simulator/session_record.h"
#include "host/simulator/simulation.h"
#include "host/simulator/states_output.h"
#include "host/support/atomic_file.h"
#include "host/support/csv_table.h"
#include "host/support/error.h"
#include "host/support/standard_streams.h"

namespace torquer::simulator {

namespace {

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

// Says once of each instrument how far it is commanded beyond its length.
class ClampingWarning {
 public:
  explicit ClampingWarning(const scene::Scene& scene) : scene_(scene) {}
  void Look(const std::vector<Command>& commands) {
    for (int k = 0; k < scene_.stack().size(); ++k) {
      const double longest_mm = scene_.stack().instrument(k).max_length_mm();
      double most_mm = 0;
      for (const Command& command : commands) {
        most_mm = std::max(most_mm, command.target[k].insertion_mm);
      }
      bool& said = said_[static_cast<std::size_t>(k)];
      if (said || most_mm <= longest_mm) continue;
      said = true;
      fmt::print(stderr,
                 "torquer-simulator: {} is commanded to {:g} mm past the entry point and is "
                 "clamped to its max_length_mm, {:g}\n",
                 scene_.instruments()[static_cast<std::size_t>(k)].name, most_mm, longest_mm);
    }
  }

 private:
  const scene::Scene& scene_;
  std::array<bool, kMostInstruments> said_{};
};

// Where rows come from: a file, all of which is checked first, or standard input, row by row.
class ScriptRows {
 public:
  ScriptRows(const std::string& script, const scene::Scene& scene, StandardStreams& streams)
      : warning_(scene) {
    if (script != kStandardStream) {
      file_ = ReadScript(script, scene);
      warning_.Look(file_);
      return;
    }
    reader_.emplace("standard input", [&streams] { return streams.NextLine(); });
    if (reader_->ReadHeader()) {
      columns_.emplace(reader_->table(), scene);
    } else if (!streams.interrupted()) {
      throw UserError("standard input:1: empty; the first line must name the columns");
    }
  }

  std::optional<Command> Next() {
    if (!reader_) {
      if (given_ == file_.size()) return std::nullopt;
      return file_[given_++];
    }
    const std::optional<CsvRow> row = columns_ ? reader_->Next() : std::nullopt;
    if (!row) return std::nullopt;
    ++given_;
    const Command command = columns_->Read(*row);
    warning_.Look({command});
    return command;
  }

  // As far as is known.
  std::size_t count() const { return reader_ ? given_ : file_.size(); }
  bool from_file() const { return !reader_; }

 private:
  ClampingWarning warning_;
  std::vector<Command> file_;
  std::optional<CsvReader> reader_;
  std::optional<ScriptColumns> columns_;
  std::size_t given_ = 0;
};

}  // namespace

ScriptResult RunScript(scene::Scene& scene, const std::string& script, const ScriptOutputs& outputs,
                       const std::atomic<bool>& stop) {
  StandardStreams streams(stop, outputs.states == kStandardStream);
  ScriptRows rows(script, scene, streams);
  Simulation simulation(scene);
  PictureFolder pictures(outputs.pictures, simulation);
  std::optional<StatesOutput> states;
  if (!outputs.states.empty()) {
    states.emplace(outputs.states, StateFields(simulation, outputs.fields), streams);
  }
  std::optional<SessionRecord> record;
  if (!outputs.record.empty()) record.emplace(outputs.record, simulation);
  const bool shows_progress = rows.from_file() && isatty(fileno(stderr)) != 0;
  std::optional<double> first_s;
  ScriptResult result;
  RowRun run(simulation);
  while (!stop) {
    const std::optional<Command> next = rows.Next();
    if (!next) {
      if (!streams.interrupted()) result.end = ScriptEnd::kLastRow;
      break;
    }
    Command row = *next;
    if (!first_s) first_s = row.time_s;
    row.time_s -= *first_s;
    double solve_us = 0;
    std::int64_t start_us = bus::MonotonicUs();
    const auto after_tick = [&] {
      solve_us += static_cast<double>(bus::MonotonicUs() - start_us);
      pictures.Write(simulation);
      start_us = bus::MonotonicUs();
      return !stop;
    };
    // A row may be an hour of ticks; one that is left unfinished has no state.
    if (!run.GoTo(row, after_tick)) break;
    result.unconverged += !simulation.report().converged;
    if (states && !states->Write({simulation, next->time_s, run.cost(), solve_us})) break;
    ++result.done;
    if (shows_progress && (result.done % 64 == 1 || result.done == rows.count())) {
      fmt::print(stderr, "\rrow {} of {}", result.done, rows.count());
    }
  }
  result.rows = rows.count();
  // All were done before anybody asked to stop.
  if (rows.from_file() && result.done == result.rows) result.end = ScriptEnd::kLastRow;
  if (streams.reader_gone()) result.end = ScriptEnd::kReaderGone;
  if (shows_progress) fmt::print(stderr, "\n");
  if (states) states->Finish();
  if (record) record->Finish(simulation);
  return result;
}

}  // namespace torquer::simulator
