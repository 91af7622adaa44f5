// What a study is, and where it puts what it finds.
//
// A study is one subcommand of torquer-study: it measures, and hands every figure to its StudyRun,
// which prints it, keeps it as a row and puts it into the report. To add one: a file pair
// <name>.{h,cpp} with a MakeXStudy(), and its line in main.cpp.
#pragma once

#include <string>
#include <vector>

#include "host/plot/svg_plot.h"
#include "host/plot/table.h"
#include "host/support/program.h"

namespace torquer::study {

// A study speaks of tables and plots all the time.
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

/// One figure of a study.
struct ResultRow {
  std::string study;
  std::string case_name;
  std::string metric;
  double value = 0;
  std::string unit;  ///< "" for pure numbers
};

/// The row as a JSON object, without line end: {"study", "case", "metric", "value", "unit"}. A
/// value that is not finite becomes null.
std::string FormatJson(const ResultRow& row);

/// Where a running study puts its figures, tables, plots and words.
class StudyRun {
 public:
  struct Options {
    bool quick = false;  ///< fewer and smaller cases, as the study says
    bool json = false;   ///< rows as JSON lines on standard output instead of text
    std::string folder;  ///< for the files
  };
  StudyRun(std::string study, Options options);

  bool quick() const { return options_.quick; }
  /// Where the files of the study go.
  const std::string& folder() const { return options_.folder; }

  /// One figure. With --json it is on standard output at once.
  void Record(const std::string& case_name, const std::string& metric, double value,
              const std::string& unit);

  /// Begins a section of the report.
  void Section(const std::string& title);
  /// A paragraph.
  void Say(const std::string& text);
  void Show(const Table& table);
  /// The same, at the head of the report: what a reader in a hurry should see.
  void ShowFirst(const Table& table);
  /// A plot, with the sentences that say what is to be seen.
  void Draw(const Plot& plot, const std::string& caption);

  /// Where the study is, on standard error while that is a terminal; fraction in [0, 1].
  void Progress(const std::string& what, double fraction);

  /// Writes <folder>/<study>.csv, .jsonl, .html and .svg (the first plot, if any), each whole or
  /// not at all, and says where they are. `title` heads the report. Throws UserError naming the
  /// file that cannot be written.
  void Finish(const std::string& title);

  const std::vector<ResultRow>& rows() const { return rows_; }

 private:
  void Print(const std::string& text);  ///< unless standard output is for JSON
  void EndProgress();

  std::string study_;
  Options options_;
  std::vector<ResultRow> rows_;
  std::string head_;  ///< of the report, HTML
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

  virtual std::string name() const = 0;     ///< of the subcommand and of its files
  virtual std::string title() const = 0;    ///< of the report
  virtual std::string summary() const = 0;  ///< one line, for the usage
  /// Declares options beyond those that every study has.
  virtual void AddOptions(Options& options) { static_cast<void>(options); }

  /// Measures. Returns false when something that must hold did not (the program then exits 1).
  virtual bool Run(StudyRun& run) = 0;
};

/// The folder that --scenes names; that of the scenes that Torquer ships where it is empty.
std::string SceneFolder(const std::string& given);

/// Throws UserError that names the remedy unless <folder>/<scene>.toml is there.
void RequireScene(const std::string& folder, const std::string& scene);

/// Makes the folder where a study's files go. Throws UserError naming it.
void MakeFolder(const std::string& path);

/// Writes a file whole or not at all. Throws UserError naming it.
void WriteWhole(const std::string& path, const std::string& text);

}  // namespace torquer::study
