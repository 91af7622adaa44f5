#include "host/support/csv_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <optional>

#include "host/support/error.h"
#include "host/support/number.h"

namespace torquer {
namespace {

// The cells of a line, without the spaces around them.
std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> cells;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t end = std::min(line.find(',', begin), line.size());
    const std::string cell = line.substr(begin, end - begin);
    const auto first = cell.find_first_not_of(" \t");
    const auto last = cell.find_last_not_of(" \t");
    cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
    begin = end + 1;
  }
  return cells;
}

[[noreturn]] void Refuse(const std::string& path, int line, const std::string& problem) {
  throw UserError(fmt::format("{}:{}: {}", path, line, problem));
}

}  // namespace

std::vector<CsvRow> ReadCsv(const std::string& path, const std::string& header) {
  std::ifstream in(path);
  if (!in) {
    throw UserError(fmt::format("{}: cannot be read; check the path and its permissions", path));
  }
  const std::vector<std::string> names = Split(header);
  std::vector<CsvRow> rows;
  std::string line;
  bool has_header = false;
  for (int number = 1; std::getline(in, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> cells = Split(line);
    if (!has_header) {
      if (cells != names) {
        Refuse(path, number, fmt::format("the header is '{}'; it must be '{}'", line, header));
      }
      has_header = true;
      continue;
    }
    if (cells.size() != names.size()) {
      Refuse(
          path, number,
          fmt::format("{} values; the header '{}' names {}", cells.size(), header, names.size()));
    }
    rows.push_back({number, std::move(cells)});
  }
  if (!has_header) {
    Refuse(path, 1, fmt::format("empty; the first line must be '{}'", header));
  }
  return rows;
}

double CsvNumber(const std::string& path, const std::string& header, const CsvRow& row,
                 std::size_t column) {
  const std::string& cell = row.cells[column];
  const std::optional<double> value = ParseNumber(cell);
  if (!value) {
    Refuse(path, row.line,
           fmt::format("{} is '{}'; give a finite number", Split(header)[column], cell));
  }
  return *value;
}

}  // namespace torquer
