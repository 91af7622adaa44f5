// A small table for people: the same on a terminal and in a report.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace torquer::plot {

struct Table {
  std::string caption;                         ///< one line
  std::vector<std::string> header;             ///< first column: subject of the row
  std::vector<std::vector<std::string>> rows;  ///< as many cells as the header has
};

/// Columns aligned (the first to the left, the others to the right), each line ended.
std::string FormatText(const Table& table);
/// A <figure> with the table; all text is escaped.
std::string FormatHtml(const Table& table);

/// A number with `digits` significant digits, as people write it: "0.0125", "1230", "3.1e-07".
std::string Number(double value, int digits = 3);

/// Escapes the special characters of HTML and SVG in a text. The result fits between tags, and into
/// attributes in double quotes.
std::string EscapeMarkup(std::string_view text);

}  // namespace torquer::plot
