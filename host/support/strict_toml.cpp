#include "host/support/strict_toml.h"

#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "host/support/error.h"
#include "host/support/input_file.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"
#include "host/support/toml_values.h"

namespace torquer {

struct StrictTable::Impl {
  std::shared_ptr<const toml::table> root;  // keeps `table` alive
  const toml::table* table = nullptr;
  std::string path;
  std::string prefix;  // "wire." inside [wire]
  std::set<std::string> known;
  std::map<std::string, std::vector<std::unique_ptr<StrictTable>>> children;

  const toml::node* Find(const std::string& key) {
    known.insert(key);
    return table->get(key);
  }
};

namespace {

// Value as in the file. A number has the fewest digits that identify it, as people write it.
std::string Written(const toml::node& node) {
  if (node.is_table()) return "{ .. }";
  if (node.is_floating_point()) {
    const std::string number = fmt::to_string(*node.value<double>());
    // In TOML a number without a fraction would be an integer.
    return number + (number.find_first_not_of("-0123456789") == std::string::npos ? ".0" : "");
  }
  if (const toml::array* array = node.as_array()) {
    std::vector<std::string> elements;
    for (const toml::node& element : *array) elements.push_back(Written(element));
    return elements.empty() ? "[]" : fmt::format("[ {} ]", fmt::join(elements, ", "));
  }
  std::string text;
  node.visit([&](const auto& typed) { text = fmt::to_string(fmt::streamed(typed)); });
  return text;
}

// Value in one line, shortened if it is long.
std::string Show(const toml::node& node) {
  constexpr std::size_t kLongest = 60;
  const std::string text = Written(node);
  std::string line;
  for (const char character : text) {
    const bool space = character == ' ' || character == '\n';
    if (!space || line.empty() || line.back() != ' ') line += space ? ' ' : character;
  }
  return line.size() > kLongest ? line.substr(0, kLongest - 3) + "..." : line;
}

// The TOML library recurses with every level, so too many levels overflow the stack.
constexpr int kMostDepth = 32;     // of arrays and inline tables
constexpr int kMostKeyParts = 32;  // of a dotted key or the name of a table
// Limit for a key or value, outside of texts and comments. All valid ones are shorter.
constexpr int kMostPieceBytes = 4096;
// Limit for one list of tables: readers may compare each table with each other one.
constexpr std::size_t kMostTables = 1000;

// End of the string that begins at `at`: behind its closing quotes, or the end of the line or text.
std::size_t EndOfString(const std::string& text, std::size_t at) {
  const char quote = text[at];
  const bool several_lines = text.compare(at, 3, std::string(3, quote)) == 0;
  const std::string closing(several_lines ? 3 : 1, quote);
  for (at += closing.size(); at < text.size(); ++at) {
    if (text.compare(at, closing.size(), closing) == 0) return at + closing.size();
    if (text[at] == '\n' && !several_lines) return at;
    if (text[at] == '\\' && quote == '"') ++at;
  }
  return text.size();
}

// Refuses too deep nesting and too long pieces before the recursion of the library.
void CheckDepth(const std::string& text, const std::string& path) {
  int depth = 0, parts = 1, bytes = 0;
  for (std::size_t at = 0; at < text.size();) {
    const char character = text[at];
    if (character == '"' || character == '\'') {
      at = EndOfString(text, at);
      continue;
    }
    if (character == '#') {
      at = std::min(text.find('\n', at), text.size());
      continue;
    }
    if (character == '[' || character == '{') ++depth;
    if (character == ']' || character == '}') depth = std::max(depth - 1, 0);
    if (character == '.') ++parts;
    if (character != ' ' && character != '\t') ++bytes;
    if (std::string_view("[]{}=,\n").find(character) != std::string_view::npos) {
      parts = 1;
      bytes = 0;
    }
    if (depth > kMostDepth || parts > kMostKeyParts || bytes > kMostPieceBytes) {
      throw UserError(fmt::format(
          "{}:{}: {}", path,
          1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'),
          depth > kMostDepth
              ? fmt::format("arrays or tables are nested more than {} deep; flatten it", kMostDepth)
          : parts > kMostKeyParts
              ? fmt::format("a key has more than {} parts; flatten it", kMostKeyParts)
              : fmt::format("a key or value has more than {} bytes; shorten it", kMostPieceBytes)));
    }
    ++at;
  }
}

std::string Range(const char* what, double lowest, double highest) {
  return fmt::format("{} from {:g} to {:g}", what, lowest, highest);
}

}  // namespace

TableOrigin::TableOrigin(std::string name) : name_(std::move(name)) {}
TableOrigin::TableOrigin(const TableOrigin&) = default;
TableOrigin::TableOrigin(TableOrigin&&) noexcept = default;
TableOrigin& TableOrigin::operator=(const TableOrigin&) = default;
TableOrigin& TableOrigin::operator=(TableOrigin&&) noexcept = default;
TableOrigin::~TableOrigin() = default;

bool TableOrigin::Has(const std::string& key) const { return keys_.count(key) > 0; }

void TableOrigin::Refuse(const std::string& key, const std::string& problem) const {
  const auto place = keys_.find(key);
  const bool given = place != keys_.end();
  const std::string& where = given ? place->second.where : where_;
  constexpr std::size_t kMostBytesOfKey = 200;
  throw UserError((where.empty() ? "" : where + ": ") + (name_.empty() ? "" : name_ + ".") +
                  Printable(key, kMostBytesOfKey) + (given ? " = " + place->second.value : "") +
                  ": " + problem);
}

StrictTable::StrictTable(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StrictTable::StrictTable(StrictTable&&) noexcept = default;
StrictTable& StrictTable::operator=(StrictTable&&) noexcept = default;
StrictTable::~StrictTable() = default;

StrictTable StrictTable::Read(const std::string& path) {
  return Parse(ReadInputFile(path, "check the path and its permissions"), path);
}

StrictTable StrictTable::Parse(const std::string& text, const std::string& path) {
  return Parse(text, path, {});
}

StrictTable StrictTable::Parse(const std::string& text, const std::string& path,
                               const TomlValues& values) {
  CheckDepth(text, path);
  auto impl = std::make_unique<Impl>();
  try {
    auto root = std::make_shared<toml::table>(toml::parse(text, path));
    SetValues(values, path, *root);
    impl->root = std::move(root);
  } catch (const toml::parse_error& error) {
    throw UserError(fmt::format("{}:{}: not valid TOML: {}; correct the syntax", path,
                                error.source().begin.line, error.description()));
  }
  impl->table = impl->root.get();
  impl->path = path;
  return StrictTable(std::move(impl));
}

std::string StrictTable::Where(const std::string& key) const {
  const toml::node* node = key.empty() ? nullptr : impl_->table->get(key);
  if (node == nullptr) node = impl_->table;
  const auto line = node->source().begin.line;
  return line > 0 ? fmt::format("{}:{}", impl_->path, line) : impl_->path;
}

TableOrigin StrictTable::Origin() const {
  TableOrigin origin(impl_->prefix.substr(0, impl_->prefix.size() - !impl_->prefix.empty()));
  origin.where_ = Where();
  for (const auto& [key, value] : *impl_->table) {
    const std::string name(key.str());
    origin.keys_[name] = {Where(name), Show(value)};
  }
  return origin;
}

void StrictTable::Refuse(const std::string& key, const std::string& problem) const {
  Origin().Refuse(key, problem);
}

bool StrictTable::Has(const std::string& key) const {
  impl_->known.insert(key);
  return impl_->table->contains(key);
}

bool StrictTable::IsText(const std::string& key) const {
  impl_->known.insert(key);
  const toml::node* node = impl_->table->get(key);
  return node != nullptr && node->is_string();
}

double StrictTable::Number(const std::string& key, double lowest, double highest) {
  const toml::node* node = impl_->Find(key);
  const std::string range = Range("a number", lowest, highest);
  if (node == nullptr) Refuse(key, "is missing; give " + range);
  const auto value = node->value<double>();
  if (!node->is_number() || !value) Refuse(key, "is not a number; give " + range);
  // Written so that NaN fails.
  if (!(*value >= lowest && *value <= highest)) Refuse(key, "is out of range; give " + range);
  return *value;
}

double StrictTable::Number(const std::string& key, double lowest, double highest, double fallback) {
  return impl_->Find(key) == nullptr ? fallback : Number(key, lowest, highest);
}

int StrictTable::Integer(const std::string& key, int lowest, int highest) {
  const toml::node* node = impl_->Find(key);
  const std::string range = fmt::format("an integer from {} to {}", lowest, highest);
  if (node == nullptr) Refuse(key, "is missing; give " + range);
  const auto value = node->value_exact<std::int64_t>();
  if (!value) Refuse(key, "is not an integer; give " + range);
  if (*value < lowest || *value > highest) Refuse(key, "is out of range; give " + range);
  return static_cast<int>(*value);
}

int StrictTable::Integer(const std::string& key, int lowest, int highest, int fallback) {
  return impl_->Find(key) == nullptr ? fallback : Integer(key, lowest, highest);
}

bool StrictTable::Boolean(const std::string& key, bool fallback) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return fallback;
  const auto value = node->value_exact<bool>();
  if (!value) Refuse(key, "is not true or false");
  return *value;
}

std::string StrictTable::AnyText(const std::string& key) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) Refuse(key, "is missing; give a text in quotes");
  const auto value = node->value_exact<std::string>();
  if (!value) Refuse(key, "is not a text; give one in quotes");
  return *value;
}

std::string StrictTable::Text(const std::string& key) {
  std::string text = AnyText(key);
  if (text.empty()) Refuse(key, "is empty; give a text");
  return text;
}

std::string StrictTable::Text(const std::string& key, const std::string& fallback) {
  return impl_->Find(key) == nullptr ? fallback : Text(key);
}

std::vector<std::string> StrictTable::Texts(const std::string& key) {
  if (IsText(key)) return {Text(key)};
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) Refuse(key, "is missing; give a list of texts");
  const toml::array* array = node->as_array();
  if (array == nullptr || array->empty()) Refuse(key, "is not a list of texts; give one or more");
  std::vector<std::string> texts;
  for (const toml::node& element : *array) {
    const auto text = element.value<std::string>();
    if (!element.is_string() || !text || text->empty()) {
      Refuse(key, "holds " + Show(element) + "; give a list of texts");
    }
    texts.push_back(*text);
  }
  return texts;
}

int StrictTable::Choice(const std::string& key, const std::vector<std::string>& choices) {
  const std::string given = Text(key);
  const auto found = std::find(choices.begin(), choices.end(), given);
  if (found != choices.end()) return static_cast<int>(found - choices.begin());
  const std::string near = NearestName(given, choices);
  Refuse(key, fmt::format("is not one of \"{}\"{}", fmt::join(choices, "\", \""),
                          near.empty() ? "" : fmt::format("; did you mean \"{}\"?", near)));
}

int StrictTable::Choice(const std::string& key, const std::vector<std::string>& choices,
                        int fallback) {
  return impl_->Find(key) == nullptr ? fallback : Choice(key, choices);
}

std::vector<double> StrictTable::Numbers(const std::string& key, double lowest, double highest) {
  const toml::node* node = impl_->Find(key);
  const std::string range = Range("a list of numbers", lowest, highest);
  if (node == nullptr) Refuse(key, "is missing; give " + range);
  if (node->is_number()) return {Number(key, lowest, highest)};
  const toml::array* array = node->as_array();
  if (array == nullptr || array->empty()) Refuse(key, "is not a list of numbers; give " + range);
  std::vector<double> values;
  for (const toml::node& element : *array) {
    const auto value = element.value<double>();
    if (!element.is_number() || !value || !(*value >= lowest && *value <= highest)) {
      Refuse(key, "holds " + Show(element) + "; give " + range);
    }
    values.push_back(*value);
  }
  return values;
}

Eigen::Vector3d StrictTable::Point(const std::string& key) {
  const std::vector<double> values = Numbers(key, -1e6, 1e6);
  if (values.size() != 3) Refuse(key, "is not a point; give [x, y, z]");
  return {values[0], values[1], values[2]};
}

std::vector<Eigen::Vector3d> StrictTable::Points(const std::string& key, std::size_t fewest) {
  const toml::node* node = impl_->Find(key);
  const std::string wanted = fmt::format("give at least {} points [x, y, z]", fewest);
  if (node == nullptr) Refuse(key, "is missing; " + wanted);
  const toml::array* array = node->as_array();
  if (array == nullptr || array->size() < fewest) Refuse(key, "is not a list of points; " + wanted);
  std::vector<Eigen::Vector3d> points;
  for (const toml::node& element : *array) {
    const toml::array* point = element.as_array();
    Eigen::Vector3d at;
    bool good = point != nullptr && point->size() == 3;
    for (std::size_t k = 0; good && k < 3; ++k) {
      const auto value = (*point)[k].value<double>();
      good = (*point)[k].is_number() && value && std::abs(*value) <= 1e6;
      if (good) at[static_cast<Eigen::Index>(k)] = *value;
    }
    if (!good) Refuse(key, "holds " + Show(element) + "; " + wanted);
    points.push_back(at);
  }
  return points;
}

StrictTable* StrictTable::OptionalTable(const std::string& key) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return nullptr;
  if (!node->is_table()) Refuse(key, "is not a table; write [" + impl_->prefix + key + "]");
  auto& children = impl_->children[key];
  if (children.empty()) {
    auto child = std::make_unique<Impl>();
    child->root = impl_->root;
    child->table = node->as_table();
    child->path = impl_->path;
    child->prefix = impl_->prefix + key + ".";
    children.push_back(std::unique_ptr<StrictTable>(new StrictTable(std::move(child))));
  }
  return children.front().get();
}

std::string StrictTable::NameOf(const std::string& key) const { return impl_->prefix + key; }

StrictTable& StrictTable::Table(const std::string& key) {
  StrictTable* table = OptionalTable(key);
  if (table == nullptr) Refuse(key, "is missing; add a table [" + NameOf(key) + "]");
  return *table;
}

std::vector<StrictTable*> StrictTable::Tables(const std::string& key) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  const std::string problem =
      fmt::format("is not a list of tables; write [[{}{}]]", impl_->prefix, key);
  if (array == nullptr) Refuse(key, problem);
  if (array->size() > kMostTables) {
    Refuse(key, fmt::format("has {} tables; give at most {}", array->size(), kMostTables));
  }
  auto& children = impl_->children[key];
  if (children.empty()) {
    for (const toml::node& element : *array) {
      if (!element.is_table()) Refuse(key, problem);
      auto child = std::make_unique<Impl>();
      child->root = impl_->root;
      child->table = element.as_table();
      child->path = impl_->path;
      child->prefix = fmt::format("{}{}[{}].", impl_->prefix, key, children.size());
      children.push_back(std::unique_ptr<StrictTable>(new StrictTable(std::move(child))));
    }
  }
  std::vector<StrictTable*> tables;
  for (const auto& child : children) tables.push_back(child.get());
  return tables;
}

std::vector<std::string> StrictTable::Keys() const {
  std::vector<std::string> keys;
  for (const auto& [key, value] : *impl_->table) keys.emplace_back(key.str());
  return keys;
}

void StrictTable::RefuseUnread() {
  const std::vector<std::string> known(impl_->known.begin(), impl_->known.end());
  for (const std::string& key : Keys()) {
    if (impl_->known.count(key) != 0) continue;
    const std::string near = NearestName(key, known);
    const std::string remedy = near.empty() ? "remove it." : fmt::format("did you mean {}?", near);
    Refuse(key, fmt::format("is not a known key; {} {}", remedy,
                            known.empty() ? std::string("This table has no keys.")
                                          : fmt::format("Keys here: {}", fmt::join(known, ", "))));
  }
  for (auto& [key, children] : impl_->children) {
    for (auto& child : children) child->RefuseUnread();
  }
}

}  // namespace torquer
