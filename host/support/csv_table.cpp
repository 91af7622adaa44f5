#include "host/support/csv_table.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "host/support/error.h"

namespace torquer {
namespace {

std::vector<std::string> Split(const std::string& line) {
  std::vector<std::string> cells;
  std::string cell;
  std::istringstream in(line);
  while (std::getline(in, cell, ',')) {
    const auto first = cell.find_first_not_of(" \t");
    const auto last = cell.find_last_not_of(" \t");
    cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
  }
  if (!line.empty() && line.back() == ',') cells.emplace_back();
  return cells;
}

std::string At(const std::string& path, int line) { return path + ":" + std::to_string(line); }

}  // namespace

std::vector<CsvRow> ReadCsv(const std::string& path, const std::string& header) {
  std::ifstream in(path);
  if (!in) throw UserError(path + ": cannot be read; check the path and its permissions");
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
        throw UserError(At(path, number) + ": the header is '" + line + "'; it must be '" + header +
                        "'");
      }
      has_header = true;
      continue;
    }
    if (cells.size() != names.size()) {
      throw UserError(At(path, number) + ": " + std::to_string(cells.size()) +
                      " values where the header '" + header + "' names " +
                      std::to_string(names.size()));
    }
    rows.push_back({number, std::move(cells)});
  }
  if (!has_header) throw UserError(path + ":1: empty; the first line must be '" + header + "'");
  return rows;
}

double CsvNumber(const std::string& path, const std::string& header, const CsvRow& row,
                 std::size_t column) {
  const std::string& cell = row.cells[column];
  char* end = nullptr;
  const double value = std::strtod(cell.c_str(), &end);
  if (cell.empty() || *end != '\0' || !std::isfinite(value)) {
    throw UserError(At(path, row.line) + ": " + Split(header)[column] + " is '" + cell +
                    "'; give a finite number");
  }
  return value;
}

}  // namespace torquer
