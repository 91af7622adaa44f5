// Tables of keys: one definition to read, check, write and document a TOML table.
//
//   Keys<FrictionSpec>  --Read-->  FrictionSpec  --Write-->  TOML
//          |
//          +--> KeyTable: the reference for people, a JSON Schema for editors
#pragma once

#include <Eigen/Core>
#include <any>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "host/support/strict_toml.h"

namespace torquer {

/// Base of the plain data of one table.
struct TableSpec {
  TableOrigin origin;  ///< place in the file, for errors that are found later
};

/// A direction in the vessel's frame, or the name of a patient's direction.
struct DirectionSpec {
  std::string name;  ///< one of PatientDirections(); "": `vector` is valid
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
};
/// Names of directions: left, right, posterior, anterior, superior, inferior. Each is followed by
/// its opposite.
const std::vector<std::string>& PatientDirections();

/// Type of value that a key takes.
enum class KeyKind {
  kNumber,
  kInteger,
  kBoolean,
  kText,
  kTexts,  ///< a list, or one text
  kChoice,
  kPoint,      ///< [x, y, z]
  kPair,       ///< [a, b]
  kNumbers,    ///< a list, or one number
  kPoints,     ///< a list of points
  kDirection,  ///< [x, y, z], or a patient's direction by name
  kTable,
  kTables,  ///< [[..]]
};

class KeyTable;

/// Documentation of one key.
struct Key {
  Key();
  Key(const Key&);
  Key(Key&&) noexcept;
  Key& operator=(const Key&);
  Key& operator=(Key&&) noexcept;
  ~Key();

  std::string name;
  KeyKind kind = KeyKind::kNumber;
  std::string unit;   ///< "": none
  double lowest = 0;  ///< of numbers
  double highest = 0;
  std::size_t fewest = 0;            ///< least number of points or tables
  std::vector<std::string> choices;  ///< of a choice
  std::string meaning;               ///< part of a sentence
  bool required = false;
  std::string fallback;             ///< value that is valid without the key, or words about it
  const KeyTable* table = nullptr;  ///< of a table or tables

  /// Permitted values in words: "number from 0 to 2".
  std::string Form() const;
};

/// Writes TOML: keys first, then the tables inside.
class TomlWriter {
 public:
  /// `table`: full name of the table, "" for the file itself.
  explicit TomlWriter(std::string table = "") : table_(std::move(table)) {}
  /// `toml`: value in TOML syntax.
  void Value(const std::string& key, const std::string& toml);
  /// Adds a table inside. Its contents are written after all values.
  TomlWriter& Table(const std::string& key, bool list = false);
  std::string Text() const;

 private:
  std::string table_;
  bool list_ = false;
  std::string values_;
  std::vector<std::unique_ptr<TomlWriter>> tables_;
};

/// All keys of one table, without the type of the data. This common code is compiled once, because
/// each table of keys is compiled for its own type.
class KeyTable {
 public:
  const std::vector<Key>& keys() const { return keys_; }
  /// Example of a table without its heading, as a user may write it.
  const std::string& example() const { return example_; }

 protected:
  /// Read one key into a spec, and write it if it differs from `base`.
  using ReadEntry = std::function<void(const Key&, StrictTable&, TableSpec&)>;
  using WriteEntry =
      std::function<void(const Key&, const TableSpec&, const TableSpec& base, TomlWriter&)>;

  KeyTable();
  KeyTable(const KeyTable&);
  KeyTable& operator=(const KeyTable&) = delete;
  ~KeyTable();

  void RequireNext() { required_ = true; }
  void OtherwiseNext(std::string_view words) { otherwise_ = words; }
  /// Appends a key, to which the functions below apply.
  Key& Add(std::string_view name, KeyKind kind, std::string_view meaning);
  Key& AddNumber(std::string_view name, KeyKind kind, double lowest, double highest,
                 std::string_view unit, std::string_view meaning);
  const Key& newest() const { return keys_.back(); }
  void SetFallback(const std::string& value);
  void SetEntry(ReadEntry read, WriteEntry write);
  /// Appends all keys of `base`; `read` and `write` handle them together.
  void AddAllOf(const KeyTable& base, ReadEntry read, WriteEntry write);
  void SetExample(std::string_view toml) { example_ = toml; }

  void ReadAll(StrictTable& table, TableSpec& spec) const;
  void WriteAll(const TableSpec& spec, const TableSpec& base, TomlWriter& out) const;
  [[noreturn]] static void RefuseTooFew(const StrictTable& table, const Key& key);

 private:
  struct Entry;
  std::vector<Key> keys_;
  std::vector<Entry> entries_;
  std::string example_;
  bool required_ = false;
  std::string otherwise_;
};

namespace key_values {

// Functions for single values: read from a table, write as TOML.
void Read(StrictTable& table, const Key& key, double& value);
void Read(StrictTable& table, const Key& key, int& value);
void Read(StrictTable& table, const Key& key, bool& value);
void Read(StrictTable& table, const Key& key, std::string& value);
void Read(StrictTable& table, const Key& key, std::vector<std::string>& value);
void Read(StrictTable& table, const Key& key, Eigen::Vector3d& value);
void Read(StrictTable& table, const Key& key, Eigen::Vector2d& value);
void Read(StrictTable& table, const Key& key, std::vector<double>& value);
void Read(StrictTable& table, const Key& key, std::vector<Eigen::Vector3d>& value);
void Read(StrictTable& table, const Key& key, DirectionSpec& value);
std::string Write(const Key& key, double value);
std::string Write(const Key& key, int value);
std::string Write(const Key& key, bool value);
std::string Write(const Key& key, const std::string& value);
std::string Write(const Key& key, const std::vector<std::string>& value);
std::string Write(const Key& key, const Eigen::Vector3d& value);
std::string Write(const Key& key, const Eigen::Vector2d& value);
std::string Write(const Key& key, const std::vector<double>& value);
std::string Write(const Key& key, const std::vector<Eigen::Vector3d>& value);
std::string Write(const Key& key, const DirectionSpec& value);
int ReadChoice(StrictTable& table, const Key& key);
void WriteChoice(const Key& key, int choice, int base, TomlWriter& out);
/// True if the key has to be read: it is present or required.
bool Wanted(const StrictTable& table, const Key& key);

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

}  // namespace key_values

/// Table of a Spec, which derives from TableSpec. It is made once by a chain of calls, one for each
/// key. A call gives the name, the member, the range, unit and meaning. A key whose member is a
/// std::optional may be missing; one after Required() must be given. Any other missing key keeps
/// the value of a new Spec.
template <class Spec>
class Keys final : public KeyTable {
 public:
  using Check = void (*)(const Spec&, StrictTable&);

  /// The next key must be given.
  Keys& Required() {
    RequireNext();
    return *this;
  }
  /// `words` describe the meaning of the missing next key, which is optional.
  Keys& Otherwise(std::string_view words) {
    OtherwiseNext(words);
    return *this;
  }

  template <class T>
  Keys& Number(std::string_view name, T Spec::*member, double lowest, double highest,
               std::string_view unit, std::string_view meaning) {
    AddNumber(name, KeyKind::kNumber, lowest, highest, unit, meaning);
    return Take(member);
  }
  template <class T>
  Keys& Integer(std::string_view name, T Spec::*member, int lowest, int highest,
                std::string_view meaning) {
    AddNumber(name, KeyKind::kInteger, lowest, highest, "", meaning);
    return Take(member);
  }
  Keys& Boolean(std::string_view name, bool Spec::*member, std::string_view meaning) {
    Add(name, KeyKind::kBoolean, meaning);
    return Take(member);
  }
  template <class T>
  Keys& Text(std::string_view name, T Spec::*member, std::string_view meaning) {
    Add(name, KeyKind::kText, meaning);
    return Take(member);
  }
  Keys& Texts(std::string_view name, std::vector<std::string> Spec::*member,
              std::string_view meaning) {
    Add(name, KeyKind::kTexts, meaning);
    return Take(member);
  }
  /// `choices`: in the order of the enumerators.
  template <class Enum>
  Keys& Choice(std::string_view name, Enum Spec::*member, std::vector<std::string> choices,
               std::string_view meaning) {
    Key& key = Add(name, KeyKind::kChoice, meaning);
    key.choices = std::move(choices);
    if (!key.required) key.fallback = key.choices[static_cast<std::size_t>(base_.*member)];
    SetEntry(
        [member](const Key& at, StrictTable& table, TableSpec& spec) {
          if (!key_values::Wanted(table, at)) return;
          static_cast<Spec&>(spec).*member = static_cast<Enum>(key_values::ReadChoice(table, at));
        },
        [member](const Key& at, const TableSpec& spec, const TableSpec& base, TomlWriter& out) {
          key_values::WriteChoice(at, static_cast<int>(static_cast<const Spec&>(spec).*member),
                                  static_cast<int>(static_cast<const Spec&>(base).*member), out);
        });
    return *this;
  }
  template <class T>
  Keys& Point(std::string_view name, T Spec::*member, std::string_view unit,
              std::string_view meaning) {
    AddNumber(name, KeyKind::kPoint, 0, 0, unit, meaning);
    return Take(member);
  }
  Keys& Pair(std::string_view name, Eigen::Vector2d Spec::*member, double lowest, double highest,
             std::string_view unit, std::string_view meaning) {
    AddNumber(name, KeyKind::kPair, lowest, highest, unit, meaning);
    return Take(member);
  }
  template <class T>
  Keys& Numbers(std::string_view name, T Spec::*member, double lowest, double highest,
                std::string_view unit, std::string_view meaning) {
    AddNumber(name, KeyKind::kNumbers, lowest, highest, unit, meaning);
    return Take(member);
  }
  Keys& Points(std::string_view name, std::vector<Eigen::Vector3d> Spec::*member,
               std::size_t fewest, std::string_view unit, std::string_view meaning) {
    AddNumber(name, KeyKind::kPoints, 0, 0, unit, meaning).fewest = fewest;
    return Take(member);
  }
  template <class T>
  Keys& Direction(std::string_view name, T Spec::*member, std::string_view meaning) {
    Add(name, KeyKind::kDirection, meaning).choices = PatientDirections();
    return Take(member);
  }
  /// A table inside. `table` must outlive this.
  template <class Inner>
  Keys& Table(std::string_view name, std::optional<Inner> Spec::*member, const Keys<Inner>& table,
              std::string_view meaning) {
    Add(name, KeyKind::kTable, meaning).table = &table;
    SetEntry(
        [member, &table](const Key& key, StrictTable& in, TableSpec& spec) {
          if (StrictTable* inner = in.OptionalTable(key.name)) {
            static_cast<Spec&>(spec).*member = table.Read(*inner);
          } else if (key.required) {
            in.Table(key.name);
          }
        },
        [member, &table](const Key& key, const TableSpec& spec, const TableSpec&, TomlWriter& out) {
          const std::optional<Inner>& inner = static_cast<const Spec&>(spec).*member;
          if (inner) table.Write(*inner, out.Table(key.name));
        });
    return *this;
  }
  /// [[tables]] inside, at least `fewest`. `table` must outlive this.
  template <class Inner>
  Keys& Tables(std::string_view name, std::vector<Inner> Spec::*member, const Keys<Inner>& table,
               std::size_t fewest, std::string_view meaning) {
    Key& added = Add(name, KeyKind::kTables, meaning);
    added.table = &table;
    added.fewest = fewest;
    added.required = fewest > 0;
    SetEntry(
        [member, &table](const Key& key, StrictTable& in, TableSpec& spec) {
          std::vector<Inner>& all = static_cast<Spec&>(spec).*member;
          for (StrictTable* inner : in.Tables(key.name)) all.push_back(table.Read(*inner));
          if (all.size() < key.fewest) RefuseTooFew(in, key);
        },
        [member, &table](const Key& key, const TableSpec& spec, const TableSpec&, TomlWriter& out) {
          for (const Inner& inner : static_cast<const Spec&>(spec).*member) {
            table.Write(inner, out.Table(key.name, true));
          }
        });
    return *this;
  }
  /// Adds all keys of a base of Spec. `base` must outlive this.
  template <class Base>
  Keys& Include(const Keys<Base>& base) {
    AddAllOf(
        base,
        [&base](const Key&, StrictTable& table, TableSpec& spec) {
          base.ReadInto(table, static_cast<Spec&>(spec));
        },
        [&base](const Key&, const TableSpec& spec, const TableSpec& other, TomlWriter& out) {
          base.Write(static_cast<const Spec&>(spec), static_cast<const Spec&>(other), out);
        });
    return *this;
  }
  /// Adds a check that runs after all keys are read and refuses through the table.
  Keys& Checked(Check check) {
    check_ = check;
    return *this;
  }
  /// Example of a table, as a user may write it.
  Keys& Example(std::string_view toml) {
    SetExample(toml);
    return *this;
  }

  /// Throws UserError naming file, line, key, value and remedy.
  Spec Read(StrictTable& table) const {
    Spec spec;
    spec.origin = table.Origin();
    ReadInto(table, spec);
    return spec;
  }
  void ReadInto(StrictTable& table, Spec& spec) const {
    ReadAll(table, spec);
    if (check_ != nullptr) check_(spec, table);
  }
  /// Writes the values that differ from a new Spec, and the required ones.
  void Write(const Spec& spec, TomlWriter& out) const { WriteAll(spec, base_, out); }
  /// Writes the values that differ from `base`. ReadInto() with `base` reads them again.
  void Write(const Spec& spec, const Spec& base, TomlWriter& out) const {
    WriteAll(spec, base, out);
  }

 private:
  // The newest key takes a value.
  template <class T>
  Keys& Take(T Spec::*member) {
    if constexpr (key_values::IsOptional<T>::value) {
      SetEntry(
          [member](const Key& key, StrictTable& table, TableSpec& spec) {
            if (!table.Has(key.name)) return;
            key_values::Read(table, key, (static_cast<Spec&>(spec).*member).emplace());
          },
          [member](const Key& key, const TableSpec& spec, const TableSpec& base, TomlWriter& out) {
            const T& given = static_cast<const Spec&>(spec).*member;
            const T& other = static_cast<const Spec&>(base).*member;
            if (!given) return;
            const std::string value = key_values::Write(key, *given);
            if (!other || value != key_values::Write(key, *other)) out.Value(key.name, value);
          });
    } else {
      SetFallback(key_values::Write(newest(), base_.*member));
      SetEntry(
          [member](const Key& key, StrictTable& table, TableSpec& spec) {
            if (!key_values::Wanted(table, key)) return;
            key_values::Read(table, key, static_cast<Spec&>(spec).*member);
          },
          [member](const Key& key, const TableSpec& spec, const TableSpec& base, TomlWriter& out) {
            const std::string value =
                key_values::Write(key, static_cast<const Spec&>(spec).*member);
            if (key.required ||
                value != key_values::Write(key, static_cast<const Spec&>(base).*member)) {
              out.Value(key.name, value);
            }
          });
    }
    return *this;
  }

  const Spec base_ = Spec();  // values without any key
  Check check_ = nullptr;
};

/// Table of keys with a hidden type of data, for one of several kinds chosen by name.
struct AnyKeys {
  const KeyTable* table = nullptr;
  std::function<std::any(StrictTable&)> read;
  std::function<void(const std::any&, TomlWriter&)> write;
};

/// `keys` must outlive the result.
template <class Spec>
AnyKeys Any(const Keys<Spec>& keys) {
  return {&keys, [&keys](StrictTable& table) { return std::any(keys.Read(table)); },
          [&keys](const std::any& spec, TomlWriter& out) {
            keys.Write(std::any_cast<const Spec&>(spec), out);
          }};
}

}  // namespace torquer
