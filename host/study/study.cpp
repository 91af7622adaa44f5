#include "host/study/study.h"

#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "host/support/atomic_file.h"
#include "host/support/error.h"
#include "host/support/error_output.h"
#include "host/support/installed.h"
#include "host/support/machine.h"

namespace torquer::study {
namespace {

constexpr char kPageStyle[] = R"(
:root { color-scheme: light; }
body { margin: 0; background: #f3f5f9; color: #1c2430;
  font: 16px/1.55 Inter, "Segoe UI", "DejaVu Sans", sans-serif; }
main { max-width: 900px; margin: 0 auto; padding: 40px 28px 80px; }
h1 { font-size: 30px; line-height: 1.2; margin: 0 0 6px; }
h2 { font-size: 21px; margin: 44px 0 8px; padding-top: 14px; border-top: 2px solid #d5dbe6; }
p { max-width: 74ch; }
.machine { color: #5d6877; font-size: 14px; margin: 0 0 26px; }
figure { margin: 18px 0 26px; background: #fff; border: 1px solid #dfe4ec; border-radius: 10px;
  padding: 14px; overflow-x: auto; }
figure svg { display: block; max-width: 100%; height: auto; margin: 0 auto; }
figcaption { color: #46515f; font-size: 14px; max-width: 82ch; }
figure.plot figcaption { margin: 8px 4px 0; }
table { border-collapse: collapse; margin-top: 8px; font-size: 14px;
  font-variant-numeric: tabular-nums; width: 100%; }
th, td { padding: 5px 10px; text-align: right; border-bottom: 1px solid #e8ecf2; }
th { color: #46515f; font-weight: 600; border-bottom: 2px solid #d5dbe6; }
th:first-child, td:first-child { text-align: left; }
tbody tr:hover { background: #f6f8fc; }
)";

double WallSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string CsvCell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string FormatCsv(const std::vector<ResultRow>& rows) {
  std::string text = "study,case,metric,value,unit\n";
  for (const ResultRow& row : rows) {
    char value[40];
    std::snprintf(value, sizeof value, "%.9g", row.value);
    text += CsvCell(row.study) + "," + CsvCell(row.case_name) + "," + CsvCell(row.metric) + "," +
            value + "," + CsvCell(row.unit) + "\n";
  }
  return text;
}

}  // namespace

std::string FormatJson(const ResultRow& row) {
  const nlohmann::ordered_json json = {{"study", row.study},
                                       {"case", row.case_name},
                                       {"metric", row.metric},
                                       {"value", row.value},
                                       {"unit", row.unit}};
  return json.dump();
}

StudyRun::StudyRun(std::string study, Options options)
    : study_(std::move(study)), options_(std::move(options)) {}

void StudyRun::Record(const std::string& case_name, const std::string& metric, double value,
                      const std::string& unit) {
  rows_.push_back({study_, case_name, metric, value, unit});
  if (!options_.json) return;
  EndProgress();
  std::cout << FormatJson(rows_.back()) << std::endl;
}

void StudyRun::Section(const std::string& title) {
  body_ += "<h2>" + EscapeMarkup(title) + "</h2>\n";
  Print("\n== " + title + "\n");
}

void StudyRun::Say(const std::string& text) {
  body_ += "<p>" + EscapeMarkup(text) + "</p>\n";
  Print(text + "\n");
}

void StudyRun::ShowFirst(const Table& table) {
  head_ += FormatHtml(table);
  Print(FormatText(table));
}

void StudyRun::Show(const Table& table) {
  body_ += FormatHtml(table);
  Print(FormatText(table));
}

void StudyRun::Print(const std::string& text) {
  if (options_.json) return;
  EndProgress();
  std::cout << text << std::flush;
}

void StudyRun::Draw(const Plot& plot, const std::string& caption) {
  const std::string picture = DrawPlot(plot);
  if (first_picture_.empty()) first_picture_ = picture;
  body_ += "<figure class=\"plot\">\n" + picture + "<figcaption>" + EscapeMarkup(caption) +
           "</figcaption></figure>\n";
}

void StudyRun::Progress(const std::string& what, double fraction) {
  static const bool terminal = isatty(STDERR_FILENO) == 1;
  if (!terminal) return;
  const double now = WallSeconds();
  if (progress_shown_ && now - last_progress_s_ < 0.1) return;
  last_progress_s_ = now;
  progress_shown_ = true;
  WriteProgress(fmt::format("\r\033[K{:3.0f} %  {}", 100 * fraction, what));
}

void StudyRun::EndProgress() {
  if (!progress_shown_) return;
  WriteProgress("\r\033[K");
  progress_shown_ = false;
}

void StudyRun::Finish(const std::string& title) {
  EndProgress();
  MakeFolder(options_.folder);
  const std::string stem = options_.folder + "/" + study_;
  std::string lines;
  for (const ResultRow& row : rows_) lines += FormatJson(row) + "\n";
  WriteWhole(stem + ".csv", FormatCsv(rows_));
  WriteWhole(stem + ".jsonl", lines);
  WriteWhole(stem + ".html",
             "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\n"
             "<meta name=\"viewport\" content=\"width=device-width\">\n<title>" +
                 EscapeMarkup(title) + "</title>\n<style>" + kPageStyle +
                 "</style></head>\n<body><main>\n<h1>" + EscapeMarkup(title) +
                 "</h1>\n<p class=\"machine\">" +
                 EscapeMarkup(DescribeMachine() + (options_.quick ? ", quick run" : "")) +
                 "</p>\n" + head_ + body_ + "</main></body></html>\n");
  if (!first_picture_.empty()) WriteWhole(stem + ".svg", first_picture_);
  Print("\nWritten: " + stem + ".csv, .jsonl, .html" + (first_picture_.empty() ? "" : ", .svg") +
        "\n");
}

std::string SceneFolder(const std::string& given) {
  return given.empty() ? FindInstalled("share/torquer/scenes").string() : given;
}

void RequireScene(const std::string& folder, const std::string& scene) {
  const std::string path = folder + "/" + scene + ".toml";
  if (!std::filesystem::exists(path)) {
    throw UserError(path + ": there is no such scene; name the folder of scenes with --scenes");
  }
}

void MakeFolder(const std::string& path) {
  std::error_code error;
  std::filesystem::create_directories(path, error);
  if (!error) return;
  throw UserError(path + ": the folder cannot be made: " + error.message() +
                  "; name a writable folder with --out");
}

void WriteWhole(const std::string& path, const std::string& text) {
  WriteFileAtomically(path, text);
}

}  // namespace torquer::study
