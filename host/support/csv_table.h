// Tables of numbers in CSV files with a fixed header.
#pragma once

#include <string>
#include <vector>

namespace torquer {

/// One row: its line in the file (the header is line 1) and its cells.
struct CsvRow {
  int line = 0;
  std::vector<std::string> cells;
};

/// Reads a CSV file whose first line must be exactly `header` (cells without quotes; blank lines
/// and lines that begin with # are skipped). Every row has as many cells as the header.
/// Throws UserError naming file, line, what is wrong, and the header that is wanted.
std::vector<CsvRow> ReadCsv(const std::string& path, const std::string& header);

/// A cell as a finite number; throws UserError naming file, line, column and value.
double CsvNumber(const std::string& path, const std::string& header, const CsvRow& row,
                 std::size_t column);

}  // namespace torquer
