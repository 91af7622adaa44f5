#include "host/simulator/program/script_run.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include "host/api/script_columns.h"
#include "host/bus/clock.h"
#include "host/simulator/program/png_file.h"
#include "host/simulator/program/states_output.h"
#include "host/simulator/session_record.h"
#include "host/support/atomic_file.h"
#include "host/support/csv_table.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/standard_streams.h"

namespace torquer::program {

namespace {

using simulator::SessionRecord;

class PictureFolder {
 public:
  PictureFolder(const std::string& path, const Simulation& simulation) : path_(path) {
    if (path_.empty()) return;
    if (simulation.picture_planes() == 0) {
      throw UserError(simulation.scene().path() +
                      ": has no X-ray picture to render; add [effects.fluoroscopy]");
    }
    std::error_code error;
    std::filesystem::create_directories(path_, error);
    if (error) throw UserError(path_ + ": the folder cannot be created (" + error.message() + ")");
    AtomicFile{NameOf(1)};  // fails before the run, not during it
  }
  void Write(Simulation& simulation) {
    if (path_.empty()) return;
    counts_.resize(static_cast<std::size_t>(simulation.picture_planes()));
    for (int plane = 0; plane < simulation.picture_planes(); ++plane) {
      if (!simulation.picture_due(plane)) continue;
      const int number = ++counts_[static_cast<std::size_t>(plane)];
      WritePng(NameOf(number, plane), simulation.LastPicture(plane));
    }
  }

 private:
  std::string NameOf(int number, int plane = 0) const {
    return fmt::format("{}/{}_{:06}.png", path_, plane == 0 ? "picture" : "lateral", number);
  }

  const std::string path_;
  std::vector<int> counts_;  // pictures of each plane
};

// Warns once for each instrument that is commanded beyond its length.
class ClampingWarning {
 public:
  explicit ClampingWarning(const Scene& scene)
      : instruments_(scene.instruments()), said_(instruments_.size()) {}
  void Look(const std::vector<ScriptRow>& rows) {
    for (std::size_t k = 0; k < instruments_.size(); ++k) {
      const double longest_mm = instruments_[k].max_length_mm;
      double most_mm = 0;
      for (const ScriptRow& row : rows) {
        most_mm = std::max(most_mm, row.command.hands[k].insertion_mm);
      }
      if (said_[k] || most_mm <= longest_mm) continue;
      said_[k] = true;
      PrintError(
          "torquer-simulator: {} is commanded to {:g} mm past the entry point and is "
          "clamped to its max_length_mm, {:g}\n",
          instruments_[k].name, most_mm, longest_mm);
    }
  }

 private:
  const std::vector<InstrumentInfo> instruments_;
  std::vector<bool> said_;
};

// Source of rows: a file that is checked completely first, or standard input row by row.
class ScriptRows {
 public:
  ScriptRows(const std::string& script, const Scene& scene, StandardStreams& streams)
      : warning_(scene) {
    if (script != kStandardStream) {
      file_ = ReadScript(script, scene.path(), scene.instruments());
      warning_.Look(file_);
      return;
    }
    reader_.emplace("standard input", [&streams] { return streams.NextLine(); });
    if (reader_->ReadHeader()) {
      columns_.emplace(reader_->table(), scene.path(), scene.instruments());
    } else if (!streams.interrupted()) {
      throw UserError("standard input:1: empty; the first line must name the columns");
    }
  }

  std::optional<ScriptRow> Next() {
    if (!reader_) {
      if (given_ == file_.size()) return std::nullopt;
      return file_[given_++];
    }
    const std::optional<CsvRow> row = columns_ ? reader_->Next() : std::nullopt;
    if (!row) return std::nullopt;
    ++given_;
    ScriptRow read = columns_->Read(*row);
    warning_.Look({read});
    return read;
  }

  // Number of rows that are known so far.
  std::size_t count() const { return reader_ ? given_ : file_.size(); }
  bool from_file() const { return !reader_; }

 private:
  ClampingWarning warning_;
  std::vector<ScriptRow> file_;
  std::optional<CsvReader> reader_;
  std::optional<ScriptColumns> columns_;
  std::size_t given_ = 0;
};

}  // namespace

ScriptResult RunScript(const Scene& scene, const std::string& script, const ScriptOutputs& outputs,
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
  if (!outputs.record.empty()) {
    record.emplace(outputs.record, scene.path(), !simulation.readings().empty());
  }
  const bool shows_progress = rows.from_file() && isatty(fileno(stderr)) != 0;
  ScriptResult result;
  while (!stop) {
    const std::optional<ScriptRow> next = rows.Next();
    if (!next) {
      if (!streams.interrupted()) result.end = ScriptEnd::kLastRow;
      break;
    }
    RowCost cost;
    std::int64_t start_us = bus::MonotonicUs();
    const auto after_tick = [&](const StepReport& tick) {
      cost.solve_us += static_cast<double>(bus::MonotonicUs() - start_us);
      cost.last_tick = tick;
      pictures.Write(simulation);
      start_us = bus::MonotonicUs();
      return !stop;
    };
    // A row may have an hour of ticks, so `stop` can interrupt it. An unfinished row has no state.
    cost.row = simulation.StepRow(*next, after_tick);
    if (!cost.row.finished) break;
    if (states && !states->Write({simulation, next->time_s, cost})) break;
    result.unconverged += !cost.row.converged;
    ++result.done;
    if (shows_progress && (result.done % 64 == 1 || result.done == rows.count())) {
      WriteProgress(fmt::format("\rrow {} of {}", result.done, rows.count()));
    }
  }
  result.rows = rows.count();
  // All rows were done before the request to stop.
  if (rows.from_file() && result.done == result.rows) result.end = ScriptEnd::kLastRow;
  if (streams.reader_gone()) result.end = ScriptEnd::kReaderGone;
  if (shows_progress) WriteProgress("\n");
  if (states) states->Finish();
  if (record) record->Finish(simulation.Record());
  return result;
}

}  // namespace torquer::program
