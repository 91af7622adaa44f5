#include "host/simulator/scene/key_reference.h"

#include <toml++/toml.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/simulator/vessel/vessel.h"
#include "tests/support/paths.h"

using Catch::Contains;
using nlohmann::json;
using namespace torquer::scene;

namespace {

std::string Text(const std::string& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::string Trimmed(const std::string& text) {
  return text.substr(0, text.find_last_not_of('\n') + 1);
}

// Schema alternative for a kind of vessel; null if there is none.
const json* Alternative(const json& schema, const std::string& kind) {
  for (const json& one : schema["properties"]["vessel"]["oneOf"]) {
    if (one["properties"]["kind"]["const"] == kind) return &one;
  }
  return nullptr;
}

// Checks that every key of a table has its property with kind, range and required flag.
void CheckProperties(const torquer::KeyTable& table, const json& schema) {
  for (const torquer::Key& key : table.keys()) {
    INFO(key.name);
    REQUIRE(schema["properties"].contains(key.name));
    const json& property = schema["properties"][key.name];
    CHECK_THAT(property["description"].get<std::string>(), Contains(key.meaning));
    const json required = schema.value("required", json::array());
    CHECK((std::find(required.begin(), required.end(), key.name) != required.end()) ==
          key.required);
    if (key.kind == torquer::KeyKind::kNumber || key.kind == torquer::KeyKind::kInteger) {
      CHECK(property["minimum"] == key.lowest);
      CHECK(property["maximum"] == key.highest);
    }
    if (key.kind == torquer::KeyKind::kPair) {
      CHECK(property["items"]["maximum"] == key.highest);
      CHECK(property["minItems"] == 2);
      CHECK(property["maxItems"] == 2);
    }
    if (key.kind == torquer::KeyKind::kChoice) CHECK(property["enum"] == key.choices);
    if (key.kind == torquer::KeyKind::kTable) CheckProperties(*key.table, property);
    if (key.kind == torquer::KeyKind::kTables) CheckProperties(*key.table, property["items"]);
  }
  CHECK(schema["additionalProperties"] == false);
}

// Checks that a table of a scene file has only entries that the schema allows. A `whole` table must
// also have all that the schema requires.
void CheckAgainst(const toml::table& table, const json& schema, bool whole = true) {
  for (const auto& [key, node] : table) {
    const std::string name(key.str());
    INFO(name);
    REQUIRE(schema["properties"].contains(name));
    const json& property = schema["properties"][name];
    const toml::array* const array = node.as_array();
    if (const toml::table* inner = node.as_table()) {
      const json* const kind = property.contains("oneOf")
                                   ? Alternative(schema, *(*inner)["kind"].value<std::string>())
                                   : &property;
      REQUIRE(kind != nullptr);
      CheckAgainst(*inner, *kind, whole);
    } else if (array != nullptr && !array->empty() && array->front().is_table()) {
      CHECK(property["type"] == "array");
      for (const toml::node& element : *array) {
        CheckAgainst(*element.as_table(), property["items"], whole);
      }
    }
  }
  if (!whole) return;
  for (const json& key : schema.value("required", json::array())) {
    CHECK(table.contains(key.get<std::string>()));
  }
}

}  // namespace

TEST_CASE("The reference of the keys in host/scenes is that of the tables", "[scene]") {
  const std::string readme = Trimmed(Text(torquer::test::SourcePath("/host/scenes/README.md")));
  const std::string keys = Trimmed(KeysAsMarkdown());
  REQUIRE(keys.size() > 5000);
  INFO("write it with: torquer-simulator --list-keys --markdown");
  CHECK(readme.size() > keys.size());
  CHECK(readme.ends_with(keys));
}

TEST_CASE("The references name every section and every key", "[scene]") {
  const std::string markdown = KeysAsMarkdown();
  const std::string text = KeysAsText();
  std::set<std::string> names;
  for (const Section& section : AllSections()) {
    INFO(section.name);
    CHECK(names.insert(section.name).second);
    CHECK_THAT(text, Contains(section.heading) && Contains(section.summary));
    CHECK_THAT(markdown, Contains(section.heading) && Contains(section.summary));
    for (const torquer::Key& key : section.keys->keys()) {
      CHECK_THAT(text, Contains(key.name + ": " + key.meaning));
      CHECK_THAT(markdown, Contains("| `" + key.name + "` | "));
    }
  }
  for (const auto& kind : torquer::vessel::AllVesselKinds()) {
    CHECK(names.count("vessel." + kind.name) == 1);
  }
  for (const auto& kind : torquer::effects::AllEffects()) {
    CHECK(names.count("effects." + kind.name) == 1);
  }
}

TEST_CASE("The examples of the reference hold keys that a scene may have", "[scene]") {
  const json schema = json::parse(KeysAsJsonSchema());
  const std::string markdown = KeysAsMarkdown();
  int examples = 0;
  for (std::size_t at = 0; (at = markdown.find("```toml\n", at)) != std::string::npos;) {
    at += 8;
    const std::string example = markdown.substr(at, markdown.find("```", at) - at);
    INFO(example);
    ++examples;
    CheckAgainst(toml::parse(example), schema, false);
    at += example.size() + 3;
  }
  CHECK(examples >= static_cast<int>(torquer::effects::AllEffects().size()));
}

TEST_CASE("The JSON Schema has every section and every key", "[scene]") {
  const json schema = json::parse(KeysAsJsonSchema());
  CHECK_THAT(schema["$schema"].get<std::string>(), Contains("draft-07"));
  CHECK(schema["additionalProperties"] == false);
  CHECK(schema["required"] == json({"vessel", "entry", "instrument", "name"}));
  const json& effects = schema["properties"]["effects"];
  CHECK(effects["additionalProperties"] == false);
  const torquer::KeyTable* every_vessel = nullptr;
  for (const Section& section : AllSections()) {
    INFO(section.name);
    const auto dot = section.name.find('.');
    const std::string table = section.name.substr(0, dot);
    const std::string part = dot == std::string::npos ? "" : section.name.substr(dot + 1);
    if (section.name.empty()) {
      CHECK(schema["properties"].contains("name"));
    } else if (section.name == "vessel") {
      every_vessel = section.keys;
    } else if (table == "vessel") {
      const json* const kind = Alternative(schema, part);
      REQUIRE(kind != nullptr);
      CheckProperties(*section.keys, *kind);
      REQUIRE(every_vessel != nullptr);
      CheckProperties(*every_vessel, *kind);
    } else if (table == "effects") {
      REQUIRE(effects["properties"].contains(part));
      CheckProperties(*section.keys, effects["properties"][part]);
    } else if (table == "instrument") {
      CHECK(schema["properties"][table]["type"] == "array");
      CheckProperties(*section.keys, schema["properties"][table]["items"]);
    } else {
      REQUIRE(schema["properties"].contains(table));
      CheckProperties(*section.keys, schema["properties"][table]);
    }
  }
}

TEST_CASE("Every shipped scene is valid by the JSON Schema", "[scene]") {
  const json schema = json::parse(KeysAsJsonSchema());
  for (const auto& entry :
       std::filesystem::directory_iterator(torquer::test::SourcePath("/host/scenes"))) {
    if (entry.path().extension() != ".toml") continue;
    INFO(entry.path());
    CheckAgainst(toml::parse_file(entry.path().string()), schema);
  }
}
