#include "host/simulator/scene/value_of_key.h"

#include <fmt/format.h>

#include <cstdlib>
#include <optional>
#include <sstream>

#include "host/simulator/scene/instrument_spec.h"
#include "host/support/error.h"
#include "host/support/printable_text.h"
#include "host/support/strict_toml.h"

namespace torquer::scene {

namespace {

constexpr double kAny = 1e300;
constexpr char kInstrument[] = "instrument";

std::vector<std::string> PartsOf(const std::string& key) {
  std::vector<std::string> parts;
  std::istringstream in(key);
  for (std::string part; std::getline(in, part, '.');) parts.push_back(part);
  return parts;
}

std::optional<std::vector<double>> In(StrictTable& table, const std::string& key) {
  if (!table.Has(key)) return std::nullopt;
  return table.Numbers(key, -kAny, kAny);
}

StrictTable* FindInstrument(StrictTable& file, const std::string& name) {
  for (StrictTable* const table : file.Tables(kInstrument)) {
    if (table->Text("name", kGuidewire) == name) return table;
  }
  return nullptr;
}

// All values of an instrument, also those of its device.
std::optional<std::vector<double>> InInstrument(const SceneSpec& spec, const std::string& name,
                                                const std::string& key) {
  for (const InstrumentSpec& instrument : spec.instruments) {
    if (instrument.name != name) continue;
    TomlWriter out;
    InstrumentKeys().Write(instrument, out);
    StrictTable all = StrictTable::Parse(out.Text(), spec.path);
    return In(all, key);
  }
  return std::nullopt;
}

// Number that is valid without the key.
std::optional<std::vector<double>> Fallback(const std::string& section, const std::string& name) {
  for (const Section& one : AllSections()) {
    if (one.name != section) continue;
    for (const Key& key : one.keys->keys()) {
      if (key.name != name || key.fallback.empty()) continue;
      char* end = nullptr;
      const double number = std::strtod(key.fallback.c_str(), &end);
      if (*end == '\0') return std::vector<double>{number};
    }
  }
  return std::nullopt;
}

}  // namespace

std::vector<double> NumbersOf(const SceneSpec& spec, const std::string& key) {
  const std::vector<std::string> parts = PartsOf(key);
  StrictTable file = StrictTable::Parse(spec.text, spec.path, spec.values);
  StrictTable* table = &file;
  const bool of_instrument = parts.size() == 3 && parts[0] == kInstrument;
  if (of_instrument) {
    table = FindInstrument(file, parts[1]);
  } else {
    for (std::size_t k = 0; k + 1 < parts.size() && table != nullptr; ++k) {
      table = table->OptionalTable(parts[k]);
    }
  }
  std::optional<std::vector<double>> found;
  if (table != nullptr && !parts.empty()) found = In(*table, parts.back());
  if (!found && of_instrument) found = InInstrument(spec, parts[1], parts[2]);
  if (!found && table != nullptr && parts.size() > 1) {
    const std::string section = of_instrument ? kInstrument : key.substr(0, key.rfind('.'));
    found = Fallback(section, parts.back());
  }
  if (found) return *found;
  throw UserError(
      fmt::format("{}: the scene has no number with the key \"{}\"; name a key that it has, as in "
                  "\"instrument.guidewire.rigidity_N_mm2\", or give the key a value there",
                  spec.path, Printable(key)));
}

}  // namespace torquer::scene
