#include "host/plot/table.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdio>

namespace torquer::plot {
namespace {

// Characters that a terminal shows: UTF-8 continuation bytes take no column.
std::size_t Columns(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
}

}  // namespace

std::string FormatText(const Table& table) {
  std::vector<std::size_t> width;
  for (const std::string& cell : table.header) width.push_back(Columns(cell));
  for (const auto& row : table.rows) {
    assert(row.size() == width.size());
    for (std::size_t c = 0; c < row.size(); ++c) width[c] = std::max(width[c], Columns(row[c]));
  }
  std::string text = table.caption + "\n";
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line = " ";
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string space(width[c] - Columns(row[c]), ' ');
      line += c == 0 ? " " + row[c] + space : "  " + space + row[c];
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  };
  add(table.header);
  for (const auto& row : table.rows) add(row);
  return text;
}

std::string FormatHtml(const Table& table) {
  std::string html = "<figure class=\"table\"><figcaption>" + EscapeMarkup(table.caption) +
                     "</figcaption>\n<table><thead><tr>";
  for (const std::string& cell : table.header) html += "<th>" + EscapeMarkup(cell) + "</th>";
  html += "</tr></thead><tbody>\n";
  for (const auto& row : table.rows) {
    html += "<tr>";
    for (const std::string& cell : row) html += "<td>" + EscapeMarkup(cell) + "</td>";
    html += "</tr>\n";
  }
  return html + "</tbody></table></figure>\n";
}

std::string Number(double value, int digits) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*g", digits, value);
  // "%g" would write 1.2e+03; a figure must show all digits left of the point.
  const double size = std::abs(value);
  if (size >= 1 && size < 1e6 && size >= std::pow(10.0, digits)) {
    std::snprintf(text, sizeof text, "%.0f", value);
  }
  return text;
}

std::string EscapeMarkup(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace torquer::plot
