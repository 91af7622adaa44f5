// Tables of numbers in CSV files.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
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

/// A CSV file whose header says what its columns are.
struct CsvTable {
  std::string path;
  int header_line = 0;
  std::vector<std::string> columns;  ///< names, each once
  std::vector<CsvRow> rows;

  /// The index of a column, or none.
  std::optional<std::size_t> Find(const std::string& column) const;
  /// A cell as a finite number; throws UserError naming file, line, column and value.
  double Number(const CsvRow& row, std::size_t column) const;
  /// Throws UserError "file:line: column is 'value'problem".
  [[noreturn]] void Refuse(const CsvRow& row, std::size_t column, const std::string& problem) const;
};

/// Reads a CSV file; cells, blank lines and comments as with ReadCsv. Throws UserError naming file
/// and line where there is no header or one of more than 1000 columns, a column stands twice or a
/// row has another number of cells.
CsvTable ReadCsvTable(const std::string& path);

/// The same of lines that come one by one, as through a pipe.
class CsvReader {
 public:
  /// `name`: in errors, in the place of a path. `next_line`: the next line without its end, or none
  /// at the end.
  CsvReader(const std::string& name, std::function<std::optional<std::string>()> next_line);

  /// Takes lines as far as the header; call it first. False where there is none. Throws UserError
  /// as ReadCsvTable.
  bool ReadHeader();
  /// The header; its rows stay empty.
  const CsvTable& table() const { return table_; }
  /// Takes lines as far as the next row; none at the end. Throws UserError naming line and remedy.
  std::optional<CsvRow> Next();

 private:
  const std::function<std::optional<std::string>()> next_line_;
  CsvTable table_;
  int lines_ = 0;
};

}  // namespace torquer
