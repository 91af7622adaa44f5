#include "host/support/toml_values.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <type_traits>

#include "host/support/error.h"
#include "host/support/nearest_name.h"
#include "host/support/printable_text.h"

namespace torquer {

namespace {

constexpr std::size_t kMostPartsOfKey = 16;

struct Place {
  const std::string& key;
  const std::string& path;

  [[noreturn]] void Refuse(const std::string& problem) const {
    throw UserError(fmt::format("{}: the key \"{}\" {}", path, Printable(key), problem));
  }
};

std::vector<std::string> PartsOf(const Place& place) {
  std::vector<std::string> parts(1);
  for (const char character : place.key) {
    if (character == '.') {
      parts.emplace_back();
    } else {
      parts.back() += character;
    }
  }
  for (const std::string& part : parts) {
    if (part.empty()) {
      place.Refuse(
          "has an empty part; give names with one dot between them, as in "
          "\"effects.friction.coefficient\"");
    }
  }
  if (parts.size() > kMostPartsOfKey) {
    place.Refuse(fmt::format("has more than {} parts; give a key of a scene", kMostPartsOfKey));
  }
  return parts;
}

// Table of a list that has this name. One without a name has its number as name, from 0.
toml::table& Named(const Place& place, const std::string& list, toml::array& all,
                   const std::string& name) {
  std::vector<std::string> names;
  for (toml::node& element : all) {
    toml::table* const table = element.as_table();
    if (table == nullptr)
      place.Refuse(fmt::format("leads into {}, which is not a list of tables", list));
    names.push_back(table->get_as<std::string>("name") == nullptr
                        ? std::to_string(names.size())
                        : table->get_as<std::string>("name")->get());
    if (names.back() == name) return *table;
  }
  const std::string near = NearestName(name, names);
  place.Refuse(fmt::format("names no {}; {}there are: {}", list,
                           near.empty() ? "" : fmt::format("did you mean {}? ", near),
                           fmt::join(names, ", ")));
}

template <class Element>
toml::array ToArray(const std::vector<Element>& values) {
  toml::array array;
  for (const Element& value : values) {
    if constexpr (std::is_same_v<Element, std::array<double, 3>>) {
      array.push_back(toml::array{value[0], value[1], value[2]});
    } else {
      array.push_back(value);
    }
  }
  return array;
}

void Put(const std::string& key, const TomlValue& value, toml::table& table) {
  std::visit(
      [&](const auto& typed) {
        using Type = std::decay_t<decltype(typed)>;
        if constexpr (std::is_same_v<Type, std::monostate>) {
          table.erase(key);
        } else if constexpr (std::is_scalar_v<Type> || std::is_same_v<Type, std::string>) {
          table.insert_or_assign(key, typed);
        } else {
          table.insert_or_assign(key, ToArray(typed));
        }
      },
      value);
}

void SetOne(const Place& place, const TomlValue& value, toml::table& root) {
  const std::vector<std::string> parts = PartsOf(place);
  toml::table* table = &root;
  for (std::size_t k = 0; k + 1 < parts.size(); ++k) {
    toml::node* inner = table->get(parts[k]);
    if (inner == nullptr) {
      table->insert(parts[k], toml::table());
      inner = table->get(parts[k]);
    }
    if (toml::array* const list = inner->as_array()) {
      if (k + 2 >= parts.size()) {
        place.Refuse(
            fmt::format("needs the name and the key of one table of the list; give "
                        "{}.NAME.KEY",
                        parts[k]));
      }
      table = &Named(place, parts[k], *list, parts[k + 1]);
      ++k;
    } else if (inner->is_table()) {
      table = inner->as_table();
    } else {
      place.Refuse(
          fmt::format("leads into {}, which is a value and no table; remove the part "
                      "behind it",
                      parts[k]));
    }
  }
  const bool* const is_present = std::get_if<bool>(&value);
  if (is_present != nullptr && parts.size() == 2 && parts[0] == "effects") {
    if (!*is_present) {
      table->erase(parts[1]);
    } else if (!table->contains(parts[1])) {
      table->insert(parts[1], toml::table());
    }
    return;
  }
  Put(parts.back(), value, *table);
}

}  // namespace

void SetValues(const TomlValues& values, const std::string& path, toml::table& root) {
  for (const auto& [key, value] : values) SetOne({key, path}, value, root);
}

}  // namespace torquer
