#include "host/support/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <sstream>
#include <string_view>
#include <utility>

#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/number.h"
#include "host/support/printable_text.h"

namespace torquer {
namespace {

// Excel writes this mark at the beginning of UTF-8 files.
constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

// Larger than any useful table; each name is compared with all others.
constexpr std::size_t kMostColumns = 1000;

// Longest texts of a table in a message.
constexpr std::size_t kMostBytesOfCell = 60;
constexpr std::size_t kMostBytesOfHeader = 300;

// Removes the spaces around a cell, and the quotes that R's write.csv adds to names.
std::string Trimmed(const std::string& cell) {
  const auto first = cell.find_first_not_of(" \t");
  if (first == std::string::npos) return "";
  const std::string trimmed = cell.substr(first, cell.find_last_not_of(" \t") - first + 1);
  const bool quoted = trimmed.size() >= 2 && trimmed.front() == '"' && trimmed.back() == '"';
  return quoted ? trimmed.substr(1, trimmed.size() - 2) : trimmed;
}

std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    cells.push_back(Trimmed(line.substr(begin, end - begin)));
    begin = end + 1;
  }
  return cells;
}

[[noreturn]] void Refuse(const std::string& path, int line, const std::string& problem) {
  throw UserError(fmt::format("{}:{}: {}", path, line, problem));
}

// Refuses a line that spreadsheets write in other forms than CSV, by the name of its form.
void CheckForm(const std::string& path, int number, const std::string& line) {
  // UTF-16 may lack its mark. No other text has zeros.
  const bool marked = line.starts_with("\xff\xfe") || line.starts_with("\xfe\xff");
  if (number == 1 && (marked || line.find('\0') < 2)) {
    Refuse(path, number, "the text is UTF-16; save the file as UTF-8 (in Excel: CSV UTF-8)");
  }
  if (line.find('\r') != std::string::npos) {
    Refuse(path, number,
           "carriage returns alone end the lines; save the file with line feeds (in Excel: CSV "
           "UTF-8)");
  }
}

// Refuses a header with one column whose name has other separators than commas.
void CheckSeparator(const std::string& path, int number, const std::string& name) {
  for (const auto& [separator, plural] : {std::pair(';', "semicolons"), std::pair('\t', "tabs")}) {
    if (name.find(separator) == std::string::npos) continue;
    Refuse(path, number,
           fmt::format("{} separate the columns; save the file with commas between columns and "
                       "decimal points in numbers",
                       plural));
  }
}

// True for the line "sep=," that tells Excel the separator.
bool NamesSeparator(const std::string& line) {
  return line.size() == 5 && line.starts_with("sep=");
}

// Adds a line to the table as its header, or returns it as a row. `header`: required first line; ""
// for any. Skips rows with empty cells only, which spreadsheets add.
std::optional<CsvRow> TakeLine(CsvTable& table, int number, std::string line,
                               const std::string& header) {
  if (number == 1 && line.starts_with(kByteOrderMark)) line.erase(0, kByteOrderMark.size());
  if (!line.empty() && line.back() == '\r') line.pop_back();
  if (line.empty() || line[0] == '#') return std::nullopt;
  CheckForm(table.path, number, line);
  std::vector<std::string> cells = Split(line);
  if (table.header_line == 0) {
    if (NamesSeparator(line)) return std::nullopt;
    if (cells.size() == 1) CheckSeparator(table.path, number, cells.front());
    if (!header.empty() && cells != Split(header)) {
      Refuse(table.path, number,
             fmt::format("the header is '{}'; it must be '{}'", Printable(line, kMostBytesOfHeader),
                         header));
    }
    if (cells.size() > kMostColumns) {
      Refuse(table.path, number,
             fmt::format(
                 "the header has {} columns, but at most {} are allowed; remove unused columns",
                 cells.size(), kMostColumns));
    }
    table.header_line = number;
    table.columns = std::move(cells);
    return std::nullopt;
  }
  if (std::all_of(cells.begin(), cells.end(), [](const auto& cell) { return cell.empty(); })) {
    return std::nullopt;
  }
  if (cells.size() != table.columns.size()) {
    Refuse(table.path, number,
           fmt::format("the row has {} values, but the header '{}' names {}", cells.size(),
                       Printable(fmt::to_string(fmt::join(table.columns, ",")), kMostBytesOfHeader),
                       table.columns.size()));
  }
  return CsvRow{number, std::move(cells)};
}

void CheckHeader(const CsvTable& table, const std::string& header) {
  if (table.header_line == 0) {
    Refuse(table.path, 1,
           header.empty() ? "empty; the first line must name the columns"
                          : fmt::format("empty; the first line must be '{}'", header));
  }
  for (std::size_t k = 0; k < table.columns.size(); ++k) {
    if (table.columns[k].empty()) {
      Refuse(table.path, table.header_line,
             fmt::format("column {} has no name; name it or remove it (in R: row.names = FALSE)",
                         k + 1));
    }
    if (table.Find(table.columns[k]) == k) continue;
    Refuse(
        table.path, table.header_line,
        fmt::format("the column {} appears twice", Printable(table.columns[k], kMostBytesOfCell)));
  }
}

CsvTable Parse(const std::string& text, const std::string& path, const std::string& header) {
  std::istringstream in(text);
  CsvTable table;
  table.path = path;
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    if (auto row = TakeLine(table, number, line, header)) table.rows.push_back(std::move(*row));
  }
  CheckHeader(table, header);
  return table;
}

std::string Text(const std::string& path) {
  return ReadInputFile(path, "check the path and its permissions");
}

}  // namespace

std::vector<CsvRow> ReadCsv(const std::string& path, const std::string& header) {
  return Parse(Text(path), path, header).rows;
}

CsvTable ReadCsvTable(const std::string& path) { return Parse(Text(path), path, ""); }

CsvTable ParseCsvTable(const std::string& text, const std::string& path) {
  return Parse(text, path, "");
}

CsvReader::CsvReader(const std::string& name, std::function<std::optional<std::string>()> next_line)
    : next_line_(std::move(next_line)) {
  table_.path = name;
}

bool CsvReader::ReadHeader() {
  while (table_.header_line == 0) {
    std::optional<std::string> line = next_line_();
    if (!line) return false;
    TakeLine(table_, ++lines_, std::move(*line), "");
  }
  CheckHeader(table_, "");
  return true;
}

std::optional<CsvRow> CsvReader::Next() {
  while (std::optional<std::string> line = next_line_()) {
    if (auto row = TakeLine(table_, ++lines_, std::move(*line), "")) return row;
  }
  return std::nullopt;
}

std::optional<std::size_t> CsvTable::Find(const std::string& column) const {
  const auto found = std::find(columns.begin(), columns.end(), column);
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

double CsvTable::Number(const CsvRow& row, std::size_t column) const {
  const std::optional<double> value = ParseNumber(row.cells[column]);
  if (!value) Refuse(row, column, "; give a finite number");
  return *value;
}

void CsvTable::Refuse(const CsvRow& row, std::size_t column, const std::string& problem) const {
  torquer::Refuse(path, row.line,
                  fmt::format("{} is '{}'{}", Printable(columns[column], kMostBytesOfCell),
                              Printable(row.cells[column], kMostBytesOfCell), problem));
}

double CsvNumber(const std::string& path, const std::string& header, const CsvRow& row,
                 std::size_t column) {
  const std::string& cell = row.cells[column];
  const std::optional<double> value = ParseNumber(cell);
  if (!value) {
    Refuse(path, row.line,
           fmt::format("{} is '{}'; give a finite number", Split(header)[column],
                       Printable(cell, kMostBytesOfCell)));
  }
  return *value;
}

}  // namespace torquer
