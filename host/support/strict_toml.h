// Strict TOML reader: refuses unread keys, and checks every value.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace torquer {

/// Value for a key, in place of the one in a file. std::monostate removes the key.
using TomlValue =
    std::variant<std::monostate, bool, std::int64_t, double, std::string, std::vector<double>,
                 std::vector<std::string>, std::vector<std::array<double, 3>>>;
/// Full keys with their values, in the order in which they are set. A list of tables is followed by
/// the `name` of one: "instrument.guidewire.radius_mm". For "effects.NAME", true adds an empty
/// table and false removes the table.
using TomlValues = std::vector<std::pair<std::string, TomlValue>>;

/// Places of a table's keys in the file, for errors found after the file is closed.
class TableOrigin {
 public:
  /// Origin of a table outside of any file; `name` is its full name.
  explicit TableOrigin(std::string name = "");
  TableOrigin(const TableOrigin&);
  TableOrigin(TableOrigin&&) noexcept;
  TableOrigin& operator=(const TableOrigin&);
  TableOrigin& operator=(TableOrigin&&) noexcept;
  ~TableOrigin();

  /// True if the table contained the key.
  bool Has(const std::string& key) const;
  /// Throws a UserError "file:line: table.key = value: problem".
  [[noreturn]] void Refuse(const std::string& key, const std::string& problem) const;

 private:
  friend class StrictTable;
  struct Place {
    std::string where;  // "file:line"
    std::string value;
  };
  std::string name_;   // "effects.friction"; "" for the file
  std::string where_;  // place of the table
  std::map<std::string, Place> keys_;
};

/// A table of a TOML file. Getters throw UserError naming file, line, key, value and remedy. They
/// record the requested keys, so that RefuseUnread() can name every unread key.
///
/// A getter without `fallback` refuses a missing key.
class StrictTable {
 public:
  /// Reads a file. Throws UserError if it cannot be read or is not TOML.
  static StrictTable Read(const std::string& path);
  /// Reads a text; `path` is for messages.
  static StrictTable Parse(const std::string& text, const std::string& path);
  /// The same, with `values` in place of those in the text. Throws UserError that names a key which
  /// cannot be set, and the remedy.
  static StrictTable Parse(const std::string& text, const std::string& path,
                           const TomlValues& values);

  StrictTable(StrictTable&&) noexcept;
  StrictTable& operator=(StrictTable&&) noexcept;
  ~StrictTable();

  bool Has(const std::string& key) const;
  /// True if the table has the key and its value is a text.
  bool IsText(const std::string& key) const;

  /// A number in [lowest, highest]; NaN and infinities are refused.
  double Number(const std::string& key, double lowest, double highest);
  double Number(const std::string& key, double lowest, double highest, double fallback);
  int Integer(const std::string& key, int lowest, int highest);
  int Integer(const std::string& key, int lowest, int highest, int fallback);
  bool Boolean(const std::string& key, bool fallback);
  /// A text that is not empty.
  std::string Text(const std::string& key);
  std::string Text(const std::string& key, const std::string& fallback);
  /// A text that may be empty.
  std::string AnyText(const std::string& key);
  /// Texts that are not empty; at least one. A plain text is a list of one.
  std::vector<std::string> Texts(const std::string& key);
  /// One of the names in `choices`; returns its index.
  int Choice(const std::string& key, const std::vector<std::string>& choices);
  int Choice(const std::string& key, const std::vector<std::string>& choices, int fallback);
  /// Three finite numbers.
  Eigen::Vector3d Point(const std::string& key);
  /// Numbers, each in [lowest, highest]; at least one. A plain number is a list of one.
  std::vector<double> Numbers(const std::string& key, double lowest, double highest);
  /// Points, at least `fewest`.
  std::vector<Eigen::Vector3d> Points(const std::string& key, std::size_t fewest);

  /// A table inside this one.
  StrictTable& Table(const std::string& key);
  /// A table inside this one; null if it is missing.
  StrictTable* OptionalTable(const std::string& key);
  /// [[key]] tables, in order, at most 1000; empty if there are none.
  std::vector<StrictTable*> Tables(const std::string& key);
  /// Place of this table and its keys.
  TableOrigin Origin() const;
  /// Full name of a key of this table, such as "effects.friction.region".
  std::string NameOf(const std::string& key) const;
  /// All keys of this table.
  std::vector<std::string> Keys() const;

  /// Throws for the first key, here or in a table inside, that was never read. The message names
  /// the keys that were read there, and the nearest name.
  void RefuseUnread();
  /// Throws a UserError "file:line: key = value: problem".
  [[noreturn]] void Refuse(const std::string& key, const std::string& problem) const;
  /// "file:line" of a key, or of the table itself.
  std::string Where(const std::string& key = "") const;

 private:
  struct Impl;
  explicit StrictTable(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace torquer
