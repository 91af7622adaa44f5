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

/// Reads a CSV file whose first line must be exactly `header`. Cells may have quotes around them,
/// but no comma within. Blank lines, rows of empty cells and lines that begin with # are skipped.
/// So are a byte order mark and Excel's "sep=,". Every other row has as many cells as the header.
/// Throws UserError naming file, line, problem, and the required header.
std::vector<CsvRow> ReadCsv(const std::string& path, const std::string& header);

/// Reads a cell as a finite number; throws UserError naming file, line, column and value.
double CsvNumber(const std::string& path, const std::string& header, const CsvRow& row,
                 std::size_t column);

/// A CSV file whose header names its columns.
struct CsvTable {
  std::string path;
  int header_line = 0;
  std::vector<std::string> columns;  ///< names, each once
  std::vector<CsvRow> rows;

  /// Index of a column, or none.
  std::optional<std::size_t> Find(const std::string& column) const;
  /// Reads a cell as a finite number; throws UserError naming file, line, column and value.
  double Number(const CsvRow& row, std::size_t column) const;
  /// Throws UserError "file:line: column is 'value'problem".
  [[noreturn]] void Refuse(const CsvRow& row, std::size_t column, const std::string& problem) const;
};

/// Reads a CSV file; cells, blank lines and comments as with ReadCsv. Throws UserError naming file
/// and line if the header is missing or has more than 1000 columns. A repeated column and a row
/// with another number of cells are errors, too.
CsvTable ReadCsvTable(const std::string& path);
/// The same for the text of such a file; `path` names it in errors.
CsvTable ParseCsvTable(const std::string& text, const std::string& path);

/// Reads a table from lines that arrive one by one, as through a pipe.
class CsvReader {
 public:
  /// `name`: stands for the path in errors. `next_line`: returns the next line without its end, or
  /// none at the end.
  CsvReader(const std::string& name, std::function<std::optional<std::string>()> next_line);

  /// Reads lines up to the header; call it first. Returns false if there is no header. Throws
  /// UserError as ReadCsvTable.
  bool ReadHeader();
  /// The header; its rows stay empty.
  const CsvTable& table() const { return table_; }
  /// Reads lines up to the next row; none at the end. Throws UserError naming line and remedy.
  std::optional<CsvRow> Next();

 private:
  const std::function<std::optional<std::string>()> next_line_;
  CsvTable table_;
  int lines_ = 0;
};

}  // namespace torquer
