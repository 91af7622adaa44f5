#include "host/support/key_table.h"

#include <fmt/format.h>

#include <algorithm>

namespace torquer {

using Eigen::Vector3d;

const std::vector<std::string>& PatientDirections() {
  static const std::vector<std::string> names = {"left",     "right",    "posterior",
                                                 "anterior", "superior", "inferior"};
  return names;
}

namespace {

std::string Listed(const std::vector<std::string>& names, const char* mark) {
  std::string all;
  for (std::size_t k = 0; k < names.size(); ++k) {
    all += (k == 0 ? "" : k + 1 == names.size() ? " or " : ", ") + (mark + names[k] + mark);
  }
  return all;
}

// A text in quotes, as TOML reads it back.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += std::string("\\") + c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      quoted += fmt::format("\\u{:04x}", static_cast<unsigned char>(c));
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

}  // namespace

std::string Key::Form() const {
  const std::string range = fmt::format("{:g} to {:g}", lowest, highest);
  switch (kind) {
    case KeyKind::kNumber:
      return "number from " + range;
    case KeyKind::kInteger:
      return "integer from " + range;
    case KeyKind::kBoolean:
      return "true or false";
    case KeyKind::kText:
      return "text";
    case KeyKind::kChoice:
      return Listed(choices, "\"");
    case KeyKind::kPoint:
      return "[x, y, z]";
    case KeyKind::kNumbers:
      return "a number, or a list of them, from " + range;
    case KeyKind::kPoints:
      return fmt::format("list of at least {} points [x, y, z]", fewest);
    case KeyKind::kDirection:
      return "[x, y, z], or " + Listed(choices, "\"");
    case KeyKind::kTable:
      return "table";
    case KeyKind::kTables:
      return "list of tables";
  }
  return "";
}

void TomlWriter::Value(const std::string& key, const std::string& toml) {
  values_ += key + " = " + toml + "\n";
}

TomlWriter& TomlWriter::Table(const std::string& key, bool list) {
  tables_.push_back(std::make_unique<TomlWriter>(table_.empty() ? key : table_ + "." + key));
  tables_.back()->list_ = list;
  return *tables_.back();
}

std::string TomlWriter::Text() const {
  std::string text;
  // The heading of a table that holds nothing but tables is theirs.
  if (!table_.empty() && (list_ || !values_.empty() || tables_.empty())) {
    text += list_ ? "\n[[" + table_ + "]]\n" : "\n[" + table_ + "]\n";
  }
  text += values_;
  for (const auto& table : tables_) text += table->Text();
  return text;
}

namespace key_values {

double Read(StrictTable& table, const Key& key, const double*) {
  return table.Number(key.name, key.lowest, key.highest);
}
int Read(StrictTable& table, const Key& key, const int*) {
  return table.Integer(key.name, static_cast<int>(key.lowest), static_cast<int>(key.highest), 0);
}
bool Read(StrictTable& table, const Key& key, const bool*) {
  return table.Boolean(key.name, false);
}
std::string Read(StrictTable& table, const Key& key, const std::string*) {
  return table.Text(key.name);
}
Vector3d Read(StrictTable& table, const Key& key, const Vector3d*) { return table.Point(key.name); }
std::vector<double> Read(StrictTable& table, const Key& key, const std::vector<double>*) {
  return table.Numbers(key.name, key.lowest, key.highest);
}
std::vector<Vector3d> Read(StrictTable& table, const Key& key, const std::vector<Vector3d>*) {
  return table.Points(key.name, key.fewest);
}
DirectionSpec Read(StrictTable& table, const Key& key, const DirectionSpec*) {
  if (table.IsText(key.name)) {
    return {key.choices[static_cast<std::size_t>(table.Choice(key.name, key.choices))], {}};
  }
  const Vector3d vector = table.Point(key.name);
  if (!(vector.norm() > 1e-9)) table.Refuse(key.name, "has no length; give a direction");
  return {"", vector};
}

std::string Write(const Key& /*key*/, double value) { return fmt::format("{}", value); }
std::string Write(const Key& /*key*/, int value) { return fmt::format("{}", value); }
std::string Write(const Key& /*key*/, bool value) { return value ? "true" : "false"; }
std::string Write(const Key& /*key*/, const std::string& value) { return Quoted(value); }
std::string Write(const Key& /*key*/, const Vector3d& value) {
  return fmt::format("[{}, {}, {}]", value[0], value[1], value[2]);
}
std::string Write(const Key& /*key*/, const std::vector<double>& value) {
  if (value.size() == 1) return fmt::format("{}", value.front());
  return fmt::format("[{}]", fmt::join(value, ", "));
}
std::string Write(const Key& key, const std::vector<Vector3d>& value) {
  std::vector<std::string> points;
  for (const Vector3d& point : value) points.push_back(Write(key, point));
  return fmt::format("[{}]", fmt::join(points, ", "));
}
std::string Write(const Key& key, const DirectionSpec& value) {
  return value.name.empty() ? Write(key, value.vector) : Quoted(value.name);
}

}  // namespace key_values

}  // namespace torquer
