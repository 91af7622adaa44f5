// Study interface, and StudyRun, which collects the results of a study.
//
// A study is one subcommand of torquer-study. It measures, and passes every figure to its StudyRun.
// StudyRun prints the figure, stores it as a row and adds it to the report. To add one: a file pair
// <name>.{h,cpp} with a MakeXStudy(), and its line in main.cpp.
#pragma once

#include <string>
#include <vector>

#include "host/plot/svg_plot.h"
#include "host/plot/table.h"
#include "host/support/program.h"

namespace torquer::study {

// Short names for the tables and plots that every study uses.
using plot::Axis;
using plot::Callout;
using plot::DrawPlot;
using plot::EscapeMarkup;
using plot::FormatHtml;
using plot::FormatText;
using plot::Mark;
using plot::Number;
using plot::Plot;
using plot::Series;
using plot::Table;

/// Figure of a study.
struct ResultRow {
  std::string study;
  std::string case_name;
  std::string metric;
  double value = 0;
  std::string unit;  ///< "" for pure numbers
};

/// Formats the row as a JSON object without line end: {"study", "case", "metric", "value", "unit"}.
/// A value that is not finite becomes null.
std::string FormatJson(const ResultRow& row);

/// Collector of the figures, tables, plots and text of a running study.
class StudyRun {
 public:
  struct Options {
    bool quick = false;  ///< fewer and smaller cases, as defined by the study
    bool json = false;   ///< rows as JSON lines on standard output instead of text
    std::string folder;  ///< folder for the output files
  };
  StudyRun(std::string study, Options options);

  bool quick() const { return options_.quick; }
  /// Folder for the output files of the study.
  const std::string& folder() const { return options_.folder; }

  /// Records one figure. With --json it is written to standard output at once.
  void Record(const std::string& case_name, const std::string& metric, double value,
              const std::string& unit);

  /// Begins a section of the report.
  void Section(const std::string& title);
  /// Adds a paragraph.
  void Say(const std::string& text);
  void Show(const Table& table);
  /// Adds a table at the head of the report, for the most important results.
  void ShowFirst(const Table& table);
  /// Adds a plot with a caption that explains it.
  void Draw(const Plot& plot, const std::string& caption);

  /// Shows progress on standard error if that is a terminal; fraction in [0, 1].
  void Progress(const std::string& what, double fraction);

  /// Writes <folder>/<study>.csv, .jsonl, .html and .svg (the first plot, if any), each atomically,
  /// and prints their paths. `title` heads the report. Throws UserError with the file that cannot
  /// be written.
  void Finish(const std::string& title);

  const std::vector<ResultRow>& rows() const { return rows_; }

 private:
  void Print(const std::string& text);  ///< prints unless standard output is for JSON
  void EndProgress();

  std::string study_;
  Options options_;
  std::vector<ResultRow> rows_;
  std::string head_;  ///< head of the report, HTML
  std::string body_;
  std::string first_picture_;  ///< SVG
  double last_progress_s_ = 0;
  bool progress_shown_ = false;
};

class Study {
 public:
  Study() = default;
  Study(const Study&) = delete;
  Study& operator=(const Study&) = delete;
  virtual ~Study() = default;

  virtual std::string name() const = 0;     ///< name of the subcommand and of its files
  virtual std::string title() const = 0;    ///< title of the report
  virtual std::string summary() const = 0;  ///< one line, for the usage
  /// Declares options besides those common to all studies.
  virtual void AddOptions(Options& options) { static_cast<void>(options); }

  /// Measures. Returns false if a required condition failed (the program then exits with 1).
  virtual bool Run(StudyRun& run) = 0;
};

/// Scene folder: `given` (from --scenes), or the folder of the shipped scenes if `given` is empty.
std::string SceneFolder(const std::string& given);

/// Throws UserError with the remedy unless <folder>/<scene>.toml exists.
void RequireScene(const std::string& folder, const std::string& scene);

/// Creates the folder for a study's files. Throws UserError with its path on failure.
void MakeFolder(const std::string& path);

/// Writes a file atomically. Throws UserError with its path on failure.
void WriteWhole(const std::string& path, const std::string& text);

}  // namespace torquer::study
