#include "host/support/key_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

// Quotes a text for TOML.
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
    case KeyKind::kTexts:
      return "text, or a list of texts";
    case KeyKind::kChoice:
      return Listed(choices, "\"");
    case KeyKind::kPoint:
      return "[x, y, z]";
    case KeyKind::kPair:
      return "[a, b], each from " + range;
    case KeyKind::kNumbers:
      return "number, or list of numbers, from " + range;
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

Key::Key() = default;
Key::Key(const Key&) = default;
Key::Key(Key&&) noexcept = default;
Key& Key::operator=(const Key&) = default;
Key& Key::operator=(Key&&) noexcept = default;
Key::~Key() = default;

struct KeyTable::Entry {
  std::size_t key = 0;  // index into keys_
  ReadEntry read;
  WriteEntry write;
};

KeyTable::KeyTable() = default;
KeyTable::KeyTable(const KeyTable&) = default;
KeyTable::~KeyTable() = default;

Key& KeyTable::Add(std::string_view name, KeyKind kind, std::string_view meaning) {
  Key& key = keys_.emplace_back();
  key.name = name;
  key.kind = kind;
  key.meaning = meaning;
  key.required = std::exchange(required_, false);
  key.fallback = std::exchange(otherwise_, {});
  return key;
}

Key& KeyTable::AddNumber(std::string_view name, KeyKind kind, double lowest, double highest,
                         std::string_view unit, std::string_view meaning) {
  Key& key = Add(name, kind, meaning);
  key.lowest = lowest;
  key.highest = highest;
  key.unit = unit;
  return key;
}

void KeyTable::SetFallback(const std::string& value) {
  Key& key = keys_.back();
  if (!key.required && key.fallback.empty()) key.fallback = value;
}

void KeyTable::SetEntry(ReadEntry read, WriteEntry write) {
  entries_.push_back({keys_.size() - 1, std::move(read), std::move(write)});
}

void KeyTable::AddAllOf(const KeyTable& base, ReadEntry read, WriteEntry write) {
  keys_.insert(keys_.end(), base.keys_.begin(), base.keys_.end());
  SetEntry(std::move(read), std::move(write));
}

void KeyTable::ReadAll(StrictTable& table, TableSpec& spec) const {
  for (const Entry& entry : entries_) entry.read(keys_[entry.key], table, spec);
}

void KeyTable::WriteAll(const TableSpec& spec, const TableSpec& base, TomlWriter& out) const {
  for (const Entry& entry : entries_) entry.write(keys_[entry.key], spec, base, out);
}

void KeyTable::RefuseTooFew(const StrictTable& table, const Key& key) {
  table.Refuse(key.name,
               fmt::format("is missing; add at least {} table{} [[{}]] ({})", key.fewest,
                           key.fewest > 1 ? "s" : "", table.NameOf(key.name), key.meaning));
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
  // A table that contains only tables needs no heading.
  if (!table_.empty() && (list_ || !values_.empty() || tables_.empty())) {
    text += list_ ? "\n[[" + table_ + "]]\n" : "\n[" + table_ + "]\n";
  }
  text += values_;
  for (const auto& table : tables_) text += table->Text();
  return text;
}

namespace key_values {

void Read(StrictTable& table, const Key& key, double& value) {
  value = table.Number(key.name, key.lowest, key.highest);
}
void Read(StrictTable& table, const Key& key, int& value) {
  value = table.Integer(key.name, static_cast<int>(key.lowest), static_cast<int>(key.highest), 0);
}
void Read(StrictTable& table, const Key& key, bool& value) {
  value = table.Boolean(key.name, false);
}
void Read(StrictTable& table, const Key& key, std::string& value) { value = table.Text(key.name); }
void Read(StrictTable& table, const Key& key, std::vector<std::string>& value) {
  value = table.Texts(key.name);
}
void Read(StrictTable& table, const Key& key, Vector3d& value) { value = table.Point(key.name); }
void Read(StrictTable& table, const Key& key, Eigen::Vector2d& value) {
  const std::vector<double> numbers = table.Numbers(key.name, key.lowest, key.highest);
  if (numbers.size() != 2) {
    table.Refuse(key.name,
                 fmt::format("must have two numbers, and has {}; give [a, b]", numbers.size()));
  }
  value = {numbers[0], numbers[1]};
}
void Read(StrictTable& table, const Key& key, std::vector<double>& value) {
  value = table.Numbers(key.name, key.lowest, key.highest);
}
void Read(StrictTable& table, const Key& key, std::vector<Vector3d>& value) {
  value = table.Points(key.name, key.fewest);
}
void Read(StrictTable& table, const Key& key, DirectionSpec& value) {
  if (table.IsText(key.name)) {
    value = {key.choices[static_cast<std::size_t>(table.Choice(key.name, key.choices))], {}};
    return;
  }
  const Vector3d vector = table.Point(key.name);
  if (!(vector.norm() > 1e-9)) table.Refuse(key.name, "has no length; give a direction");
  value = {"", vector};
}

// A value that reads back as the same bits: "-0" would be an integer, and read back as 0.
std::string Exact(double value) {
  return value == 0 && std::signbit(value) ? "-0.0" : fmt::format("{}", value);
}

std::string Write(const Key& /*key*/, double value) { return Exact(value); }
std::string Write(const Key& /*key*/, int value) { return fmt::format("{}", value); }
std::string Write(const Key& /*key*/, bool value) { return value ? "true" : "false"; }
std::string Write(const Key& /*key*/, const std::string& value) { return Quoted(value); }
std::string Write(const Key& key, const std::vector<std::string>& value) {
  if (value.size() == 1) return Quoted(value.front());
  std::vector<std::string> texts;
  for (const std::string& text : value) texts.push_back(Write(key, text));
  return fmt::format("[{}]", fmt::join(texts, ", "));
}
std::string Write(const Key& /*key*/, const Vector3d& value) {
  return fmt::format("[{}, {}, {}]", Exact(value[0]), Exact(value[1]), Exact(value[2]));
}
std::string Write(const Key& /*key*/, const Eigen::Vector2d& value) {
  return fmt::format("[{}, {}]", Exact(value[0]), Exact(value[1]));
}
std::string Write(const Key& /*key*/, const std::vector<double>& value) {
  if (value.size() == 1) return Exact(value.front());
  std::vector<std::string> numbers;
  for (const double number : value) numbers.push_back(Exact(number));
  return fmt::format("[{}]", fmt::join(numbers, ", "));
}
std::string Write(const Key& key, const std::vector<Vector3d>& value) {
  std::vector<std::string> points;
  for (const Vector3d& point : value) points.push_back(Write(key, point));
  return fmt::format("[{}]", fmt::join(points, ", "));
}
std::string Write(const Key& key, const DirectionSpec& value) {
  return value.name.empty() ? Write(key, value.vector) : Quoted(value.name);
}

int ReadChoice(StrictTable& table, const Key& key) { return table.Choice(key.name, key.choices); }
void WriteChoice(const Key& key, int choice, int base, TomlWriter& out) {
  if (!key.required && choice == base) return;
  out.Value(key.name, '"' + key.choices[static_cast<std::size_t>(choice)] + '"');
}
bool Wanted(const StrictTable& table, const Key& key) {
  return key.required || table.Has(key.name);
}

}  // namespace key_values

}  // namespace torquer
