#include "host/support/strict_toml.h"

#include <toml++/toml.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <utility>

#include "host/support/error.h"

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

std::string Show(const toml::node& node) {
  std::ostringstream out;
  if (node.is_table()) return "{ .. }";
  node.visit([&](const auto& typed) { out << typed; });
  std::string text = out.str();
  if (text.size() > 60) text = text.substr(0, 57) + "...";
  return text;
}

std::string Spelled(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

}  // namespace

StrictTable::StrictTable(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
StrictTable::StrictTable(StrictTable&&) noexcept = default;
StrictTable& StrictTable::operator=(StrictTable&&) noexcept = default;
StrictTable::~StrictTable() = default;

StrictTable StrictTable::Read(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) throw UserError(path + ": cannot be read; check the path and its permissions");
  std::ostringstream text;
  text << in.rdbuf();
  return Parse(text.str(), path);
}

StrictTable StrictTable::Parse(const std::string& text, const std::string& path) {
  auto impl = std::make_unique<Impl>();
  try {
    impl->root = std::make_shared<const toml::table>(toml::parse(text, path));
  } catch (const toml::parse_error& error) {
    std::ostringstream line;
    line << error.source().begin.line;
    throw UserError(path + ":" + line.str() +
                    ": not valid TOML: " + std::string(error.description()) + "; mend the syntax");
  }
  impl->table = impl->root.get();
  impl->path = path;
  return StrictTable(std::move(impl));
}

std::string StrictTable::Where(const std::string& key) const {
  const toml::node* node = key.empty() ? nullptr : impl_->table->get(key);
  if (node == nullptr) node = impl_->table;
  std::ostringstream out;
  out << impl_->path;
  if (node->source().begin.line > 0) out << ':' << node->source().begin.line;
  return out.str();
}

void StrictTable::Refuse(const std::string& key, const std::string& problem) const {
  const toml::node* node = impl_->table->get(key);
  throw UserError(Where(key) + ": " + impl_->prefix + key +
                  (node == nullptr ? "" : " = " + Show(*node)) + ": " + problem);
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
  const std::string range = "a number from " + Spelled(lowest) + " to " + Spelled(highest);
  if (node == nullptr) Refuse(key, "is missing; give " + range);
  const auto value = node->value<double>();
  if (!node->is_number() || !value) Refuse(key, "is not a number; give " + range);
  if (!(*value >= lowest && *value <= highest)) Refuse(key, "is out of range; give " + range);
  return *value;
}

double StrictTable::Number(const std::string& key, double lowest, double highest, double fallback) {
  return impl_->Find(key) == nullptr ? fallback : Number(key, lowest, highest);
}

int StrictTable::Integer(const std::string& key, int lowest, int highest, int fallback) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return fallback;
  const std::string range =
      "an integer from " + std::to_string(lowest) + " to " + std::to_string(highest);
  const auto value = node->value_exact<std::int64_t>();
  if (!value) Refuse(key, "is not an integer; give " + range);
  if (*value < lowest || *value > highest) Refuse(key, "is out of range; give " + range);
  return static_cast<int>(*value);
}

bool StrictTable::Boolean(const std::string& key, bool fallback) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return fallback;
  const auto value = node->value_exact<bool>();
  if (!value) Refuse(key, "is not true or false");
  return *value;
}

std::string StrictTable::Text(const std::string& key) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) Refuse(key, "is missing; give a text in quotes");
  const auto value = node->value_exact<std::string>();
  if (!value || value->empty()) Refuse(key, "is not a text; give one in quotes");
  return *value;
}

std::string StrictTable::Text(const std::string& key, const std::string& fallback) {
  return impl_->Find(key) == nullptr ? fallback : Text(key);
}

int StrictTable::Choice(const std::string& key, const std::vector<std::string>& choices) {
  const std::string given = Text(key);
  const auto found = std::find(choices.begin(), choices.end(), given);
  if (found != choices.end()) return static_cast<int>(found - choices.begin());
  std::string all;
  for (const std::string& choice : choices) all += (all.empty() ? "\"" : ", \"") + choice + '"';
  const std::string near = NearestName(given, choices);
  Refuse(key, "is not one of " + all + (near.empty() ? "" : "; did you mean \"" + near + "\"?"));
}

int StrictTable::Choice(const std::string& key, const std::vector<std::string>& choices,
                        int fallback) {
  return impl_->Find(key) == nullptr ? fallback : Choice(key, choices);
}

std::vector<double> StrictTable::Numbers(const std::string& key, double lowest, double highest) {
  const toml::node* node = impl_->Find(key);
  const std::string range = "a list of numbers from " + Spelled(lowest) + " to " + Spelled(highest);
  if (node == nullptr) Refuse(key, "is missing; give " + range);
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
  const std::string wanted = "give at least " + std::to_string(fewest) + " points [x, y, z]";
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

StrictTable& StrictTable::Table(const std::string& key) {
  StrictTable* table = OptionalTable(key);
  if (table == nullptr) Refuse(key, "is missing; add a table [" + impl_->prefix + key + "]");
  return *table;
}

std::vector<StrictTable*> StrictTable::Tables(const std::string& key) {
  const toml::node* node = impl_->Find(key);
  if (node == nullptr) return {};
  const toml::array* array = node->as_array();
  if (array == nullptr)
    Refuse(key, "is not a list of tables; write [[" + impl_->prefix + key + "]]");
  auto& children = impl_->children[key];
  if (children.empty()) {
    for (const toml::node& element : *array) {
      if (!element.is_table()) {
        Refuse(key, "is not a list of tables; write [[" + impl_->prefix + key + "]]");
      }
      auto child = std::make_unique<Impl>();
      child->root = impl_->root;
      child->table = element.as_table();
      child->path = impl_->path;
      child->prefix = impl_->prefix + key + "[" + std::to_string(children.size()) + "].";
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
  for (const std::string& key : Keys()) {
    if (impl_->known.count(key) == 0) {
      const std::string near =
          NearestName(key, std::vector<std::string>(impl_->known.begin(), impl_->known.end()));
      Refuse(key, "is not a key that means anything here; " +
                      (near.empty() ? std::string("remove it") : "did you mean " + near + "?"));
    }
  }
  for (auto& [key, children] : impl_->children) {
    for (auto& child : children) child->RefuseUnread();
  }
}

std::string NearestName(const std::string& given, const std::vector<std::string>& known) {
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, given.size() / 3) + 1;
  for (const std::string& name : known) {
    // Levenshtein, one row at a time.
    std::vector<std::size_t> row(name.size() + 1);
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= given.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i;
      for (std::size_t j = 1; j < row.size(); ++j) {
        const std::size_t change = diagonal + (given[i - 1] == name[j - 1] ? 0 : 1);
        diagonal = row[j];
        row[j] = std::min({row[j] + 1, row[j - 1] + 1, change});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = name;
    }
  }
  return best;
}

}  // namespace torquer
