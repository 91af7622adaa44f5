// Tables of keys, defined once: how a TOML table is read into plain data, checked, written again
// and documented.
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
#include <utility>
#include <vector>

#include "host/support/strict_toml.h"

namespace torquer {

/// Base of the plain data of one table.
struct TableSpec {
  TableOrigin origin;  ///< where it was read, for errors that are found later
};

/// A direction of the vessel's frame, or by its name one of the patient.
struct DirectionSpec {
  std::string name;  ///< one of PatientDirections(), or "": `vector` then
  Eigen::Vector3d vector = Eigen::Vector3d::Zero();
};
/// left, right, posterior, anterior, superior, inferior: each followed by its opposite.
const std::vector<std::string>& PatientDirections();

/// What a key takes.
enum class KeyKind {
  kNumber,
  kInteger,
  kBoolean,
  kText,
  kChoice,
  kPoint,      ///< [x, y, z]
  kNumbers,    ///< a list, or one number
  kPoints,     ///< a list of points
  kDirection,  ///< [x, y, z], or a patient's direction by name
  kTable,
  kTables,  ///< [[..]]
};

class KeyTable;

/// One key, as it is documented.
struct Key {
  std::string name;
  KeyKind kind = KeyKind::kNumber;
  std::string unit;   ///< "" for none
  double lowest = 0;  ///< of numbers
  double highest = 0;
  std::size_t fewest = 0;            ///< of points and tables
  std::vector<std::string> choices;  ///< of a choice
  std::string meaning;               ///< a part of a sentence
  bool required = false;
  std::string fallback;             ///< otherwise: the value that holds without the key, or words
  const KeyTable* table = nullptr;  ///< of a table or tables

  /// What may be given, in words: "number from 0 to 2".
  std::string Form() const;
};

/// All keys of one table, whatever its data.
class KeyTable {
 public:
  const std::vector<Key>& keys() const { return keys_; }
  /// A table as a user may write it, without its heading.
  const std::string& example() const { return example_; }

 protected:
  std::vector<Key> keys_;
  std::string example_;
};

/// Writes TOML: keys first, then the tables inside.
class TomlWriter {
 public:
  /// `table`: full name of the table to be, "" for the file itself.
  explicit TomlWriter(std::string table = "") : table_(std::move(table)) {}
  /// A value as TOML writes it.
  void Value(const std::string& key, const std::string& toml);
  /// A table inside; what it returns is written after all values.
  TomlWriter& Table(const std::string& key, bool list = false);
  std::string Text() const;

 private:
  std::string table_;
  bool list_ = false;
  std::string values_;
  std::vector<std::unique_ptr<TomlWriter>> tables_;
};

namespace key_values {

// One value each: read from a table, written as TOML.
double Read(StrictTable& table, const Key& key, const double*);
int Read(StrictTable& table, const Key& key, const int*);
bool Read(StrictTable& table, const Key& key, const bool*);
std::string Read(StrictTable& table, const Key& key, const std::string*);
Eigen::Vector3d Read(StrictTable& table, const Key& key, const Eigen::Vector3d*);
std::vector<double> Read(StrictTable& table, const Key& key, const std::vector<double>*);
std::vector<Eigen::Vector3d> Read(StrictTable& table, const Key& key,
                                  const std::vector<Eigen::Vector3d>*);
DirectionSpec Read(StrictTable& table, const Key& key, const DirectionSpec*);
std::string Write(const Key& key, double value);
std::string Write(const Key& key, int value);
std::string Write(const Key& key, bool value);
std::string Write(const Key& key, const std::string& value);
std::string Write(const Key& key, const Eigen::Vector3d& value);
std::string Write(const Key& key, const std::vector<double>& value);
std::string Write(const Key& key, const std::vector<Eigen::Vector3d>& value);
std::string Write(const Key& key, const DirectionSpec& value);

template <class T>
struct IsOptional : std::false_type {};
template <class T>
struct IsOptional<std::optional<T>> : std::true_type {};

}  // namespace key_values

/// The table of a Spec, which derives from TableSpec. Made once, by a chain of calls, one a key:
/// the name, the member that takes it, what is allowed, unit and meaning. A key whose member is a
/// std::optional may be missing; one after Required() must be given; for any other the value that a
/// new Spec has holds without it.
template <class Spec>
class Keys final : public KeyTable {
 public:
  using Check = std::function<void(const Spec&, StrictTable&)>;

  /// The next key must be given.
  Keys& Required() {
    required_ = true;
    return *this;
  }
  /// Without the next key, which is optional, `words` say what holds.
  Keys& Otherwise(std::string words) {
    otherwise_ = std::move(words);
    return *this;
  }

  template <class Member>
  Keys& Number(std::string name, Member member, double lowest, double highest, std::string unit,
               std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kNumber, std::move(meaning));
    key.unit = std::move(unit);
    key.lowest = lowest;
    key.highest = highest;
    return AddValue(std::move(key), member);
  }
  template <class Member>
  Keys& Integer(std::string name, Member member, int lowest, int highest, std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kInteger, std::move(meaning));
    key.lowest = lowest;
    key.highest = highest;
    return AddValue(std::move(key), member);
  }
  Keys& Boolean(std::string name, bool Spec::*member, std::string meaning) {
    return AddValue(Make(std::move(name), KeyKind::kBoolean, std::move(meaning)), member);
  }
  template <class Member>
  Keys& Text(std::string name, Member member, std::string meaning) {
    return AddValue(Make(std::move(name), KeyKind::kText, std::move(meaning)), member);
  }
  /// `choices` in the order of the enumerators.
  template <class Enum>
  Keys& Choice(std::string name, Enum Spec::*member, std::vector<std::string> choices,
               std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kChoice, std::move(meaning));
    key.choices = std::move(choices);
    if (!key.required) key.fallback = key.choices[static_cast<std::size_t>(Spec().*member)];
    entries_.push_back(
        {[key, member](StrictTable& table, Spec& spec) {
           if (key.required || table.Has(key.name)) {
             spec.*member = static_cast<Enum>(table.Choice(key.name, key.choices));
           }
         },
         [key, member](const Spec& spec, const Spec& base, TomlWriter& out) {
           if (!key.required && spec.*member == base.*member) return;
           out.Value(key.name, '"' + key.choices[static_cast<std::size_t>(spec.*member)] + '"');
         }});
    keys_.push_back(std::move(key));
    return *this;
  }
  template <class Member>
  Keys& Point(std::string name, Member member, std::string unit, std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kPoint, std::move(meaning));
    key.unit = std::move(unit);
    return AddValue(std::move(key), member);
  }
  template <class Member>
  Keys& Numbers(std::string name, Member member, double lowest, double highest, std::string unit,
                std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kNumbers, std::move(meaning));
    key.unit = std::move(unit);
    key.lowest = lowest;
    key.highest = highest;
    return AddValue(std::move(key), member);
  }
  Keys& Points(std::string name, std::vector<Eigen::Vector3d> Spec::*member, std::size_t fewest,
               std::string unit, std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kPoints, std::move(meaning));
    key.unit = std::move(unit);
    key.fewest = fewest;
    return AddValue(std::move(key), member);
  }
  template <class Member>
  Keys& Direction(std::string name, Member member, std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kDirection, std::move(meaning));
    key.choices = PatientDirections();
    return AddValue(std::move(key), member);
  }
  /// A table inside. `table` must outlive this.
  template <class Inner>
  Keys& Table(std::string name, std::optional<Inner> Spec::*member, const Keys<Inner>& table,
              std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kTable, std::move(meaning));
    key.table = &table;
    entries_.push_back({[key, member, &table](StrictTable& in, Spec& spec) {
                          if (StrictTable* inner = in.OptionalTable(key.name)) {
                            spec.*member = table.Read(*inner);
                          } else if (key.required) {
                            in.Table(key.name);
                          }
                        },
                        [key, member, &table](const Spec& spec, const Spec&, TomlWriter& out) {
                          if (spec.*member) table.Write(*(spec.*member), out.Table(key.name));
                        }});
    keys_.push_back(std::move(key));
    return *this;
  }
  /// [[tables]] inside, at least `fewest`. `table` must outlive this.
  template <class Inner>
  Keys& Tables(std::string name, std::vector<Inner> Spec::*member, const Keys<Inner>& table,
               std::size_t fewest, std::string meaning) {
    Key key = Make(std::move(name), KeyKind::kTables, std::move(meaning));
    key.table = &table;
    key.fewest = fewest;
    key.required = fewest > 0;
    entries_.push_back({[key, member, &table](StrictTable& in, Spec& spec) {
                          for (StrictTable* inner : in.Tables(key.name)) {
                            (spec.*member).push_back(table.Read(*inner));
                          }
                          if ((spec.*member).size() < key.fewest) RefuseTooFew(in, key);
                        },
                        [key, member, &table](const Spec& spec, const Spec&, TomlWriter& out) {
                          for (const Inner& inner : spec.*member) {
                            table.Write(inner, out.Table(key.name, true));
                          }
                        }});
    keys_.push_back(std::move(key));
    return *this;
  }
  /// All keys of a base of Spec. `base` must outlive this.
  template <class Base>
  Keys& Include(const Keys<Base>& base) {
    keys_.insert(keys_.end(), base.keys().begin(), base.keys().end());
    entries_.push_back({[&base](StrictTable& table, Spec& spec) { base.ReadInto(table, spec); },
                        [&base](const Spec& spec, const Spec& other, TomlWriter& out) {
                          base.Write(spec, other, out);
                        }});
    return *this;
  }
  /// What else must hold, after all keys are read: refuses through the table.
  Keys& Checked(Check check) {
    check_ = std::move(check);
    return *this;
  }
  /// A table as a user may write it.
  Keys& Example(std::string toml) {
    example_ = std::move(toml);
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
    for (const Entry& entry : entries_) entry.read(table, spec);
    if (check_) check_(spec, table);
  }
  /// Writes what differs from a new Spec, and what must be given.
  void Write(const Spec& spec, TomlWriter& out) const { Write(spec, Spec(), out); }
  /// The same, but what differs from `base`, into which it will be read again with ReadInto.
  void Write(const Spec& spec, const Spec& base, TomlWriter& out) const {
    for (const Entry& entry : entries_) entry.write(spec, base, out);
  }

 private:
  struct Entry {
    std::function<void(StrictTable&, Spec&)> read;
    std::function<void(const Spec&, const Spec& base, TomlWriter&)> write;
  };

  Key Make(std::string name, KeyKind kind, std::string meaning) {
    Key key;
    key.name = std::move(name);
    key.kind = kind;
    key.meaning = std::move(meaning);
    key.required = std::exchange(required_, false);
    key.fallback = std::exchange(otherwise_, {});
    return key;
  }
  [[noreturn]] static void RefuseTooFew(const StrictTable& table, const Key& key) {
    table.Refuse(key.name, "is missing; add " + std::string(key.fewest > 1 ? "tables" : "a table") +
                               " [[" + table.NameOf(key.name) + "]] with " + key.meaning);
  }

  template <class T>
  Keys& AddValue(Key key, T Spec::*member) {
    if constexpr (key_values::IsOptional<T>::value) {
      using Value = typename T::value_type;
      entries_.push_back({[key, member](StrictTable& table, Spec& spec) {
                            if (table.Has(key.name)) {
                              spec.*member =
                                  key_values::Read(table, key, static_cast<const Value*>(nullptr));
                            }
                          },
                          [key, member](const Spec& spec, const Spec& base, TomlWriter& out) {
                            if (!(spec.*member)) return;
                            const std::string value = key_values::Write(key, *(spec.*member));
                            if (base.*member && value == key_values::Write(key, *(base.*member))) {
                              return;
                            }
                            out.Value(key.name, value);
                          }});
    } else {
      const std::string by_default = key_values::Write(key, Spec().*member);
      if (!key.required && key.fallback.empty()) key.fallback = by_default;
      entries_.push_back({[key, member](StrictTable& table, Spec& spec) {
                            if (key.required || table.Has(key.name)) {
                              spec.*member =
                                  key_values::Read(table, key, static_cast<const T*>(nullptr));
                            }
                          },
                          [key, member](const Spec& spec, const Spec& base, TomlWriter& out) {
                            const std::string value = key_values::Write(key, spec.*member);
                            if (key.required || value != key_values::Write(key, base.*member)) {
                              out.Value(key.name, value);
                            }
                          }});
    }
    keys_.push_back(std::move(key));
    return *this;
  }

  std::vector<Entry> entries_;
  Check check_;
  bool required_ = false;
  std::string otherwise_;
};

/// A table for those who do not know the type of its data: one of several kinds, chosen by name.
struct AnyKeys {
  const KeyTable* table = nullptr;
  std::function<std::any(StrictTable&)> read;
  std::function<void(const std::any&, TomlWriter&)> write;
};

/// `keys` must outlive what is made of it.
template <class Spec>
AnyKeys Any(const Keys<Spec>& keys) {
  return {&keys, [&keys](StrictTable& table) { return std::any(keys.Read(table)); },
          [&keys](const std::any& spec, TomlWriter& out) {
            keys.Write(std::any_cast<const Spec&>(spec), out);
          }};
}

}  // namespace torquer
