#include "host/simulator/scene/key_reference.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "host/simulator/effects/effect.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/simulator/vessel/vessel.h"

namespace torquer::scene {

namespace {

using Json = nlohmann::ordered_json;

std::string Default(const Key& key) {
  if (key.required) return "required";
  return key.fallback;
}

void AddText(const KeyTable& table, const std::string& prefix, std::string& out) {
  for (const Key& key : table.keys()) {
    out += fmt::format("  {}{}: {}", prefix, key.name, key.meaning);
    if (!key.unit.empty()) out += ", " + key.unit;
    out += "; " + key.Form();
    const std::string otherwise = Default(key);
    if (!otherwise.empty()) out += (key.required ? "; " : "; default: ") + otherwise;
    out += "\n";
    if (key.table != nullptr) AddText(*key.table, prefix + key.name + ".", out);
  }
}

void AddMarkdown(const KeyTable& table, const std::string& prefix, std::string& out) {
  for (const Key& key : table.keys()) {
    out += fmt::format("| `{}{}` | {} | {} | {} | {} |\n", prefix, key.name, key.Form(),
                       key.unit.empty() ? "" : key.unit, Default(key), key.meaning);
    if (key.table != nullptr) AddMarkdown(*key.table, prefix + key.name + ".", out);
  }
}

Json Point() {
  return {{"type", "array"}, {"items", {{"type", "number"}}}, {"minItems", 3}, {"maxItems", 3}};
}

Json SchemaOf(const KeyTable& table);

Json SchemaOf(const Key& key) {
  Json number = {{"type", "number"}, {"minimum", key.lowest}, {"maximum", key.highest}};
  switch (key.kind) {
    case KeyKind::kNumber:
      return number;
    case KeyKind::kInteger:
      return {{"type", "integer"}, {"minimum", key.lowest}, {"maximum", key.highest}};
    case KeyKind::kBoolean:
      return {{"type", "boolean"}};
    case KeyKind::kText:
      return {{"type", "string"}, {"minLength", 1}};
    case KeyKind::kTexts: {
      const Json text = {{"type", "string"}, {"minLength", 1}};
      return {
          {"anyOf", Json::array({text, {{"type", "array"}, {"items", text}, {"minItems", 1}}})}};
    }
    case KeyKind::kChoice:
      return {{"type", "string"}, {"enum", key.choices}};
    case KeyKind::kPoint:
      return Point();
    case KeyKind::kPair:
      return {{"type", "array"}, {"items", number}, {"minItems", 2}, {"maxItems", 2}};
    case KeyKind::kNumbers:
      return {{"anyOf",
               Json::array({number, {{"type", "array"}, {"items", number}, {"minItems", 1}}})}};
    case KeyKind::kPoints:
      return {{"type", "array"}, {"items", Point()}, {"minItems", key.fewest}};
    case KeyKind::kDirection:
      return {{"anyOf", Json::array({Point(), {{"type", "string"}, {"enum", key.choices}}})}};
    case KeyKind::kTable:
      return SchemaOf(*key.table);
    case KeyKind::kTables:
      return {{"type", "array"}, {"items", SchemaOf(*key.table)}, {"minItems", key.fewest}};
  }
  return {};
}

void AddKeys(const KeyTable& table, Json& schema) {
  for (const Key& key : table.keys()) {
    Json one = SchemaOf(key);
    std::string description = key.meaning;
    if (!key.unit.empty()) description += ", " + key.unit;
    if (!key.required && !key.fallback.empty()) description += "; default: " + key.fallback;
    one["description"] = std::move(description);
    schema["properties"][key.name] = std::move(one);
    if (key.required) schema["required"].push_back(key.name);
  }
}

Json EmptyTable() {
  return {{"type", "object"}, {"properties", Json::object()}, {"additionalProperties", false}};
}

Json SchemaOf(const KeyTable& table) {
  Json schema = EmptyTable();
  AddKeys(table, schema);
  return schema;
}

const KeyTable& KeysOf(const std::vector<Section>& sections, const std::string& name) {
  for (const Section& section : sections) {
    if (section.name == name) return *section.keys;
  }
  throw std::logic_error("no section " + name);
}

// One alternative for each kind, because each kind has its own keys.
Json VesselSchema(const std::vector<Section>& sections) {
  Json kinds = Json::array();
  for (const vessel::VesselKind& kind : vessel::AllVesselKinds()) {
    Json schema = EmptyTable();
    schema["properties"]["kind"] = {{"const", kind.name}, {"description", kind.summary}};
    schema["required"] = Json::array({"kind"});
    AddKeys(KeysOf(sections, "vessel"), schema);
    AddKeys(*kind.keys.table, schema);
    kinds.push_back(std::move(schema));
  }
  return {{"type", "object"}, {"oneOf", std::move(kinds)}};
}

}  // namespace

std::string KeysAsText() {
  std::string out;
  for (const Section& section : AllSections()) {
    out += fmt::format("{}{}\n", section.heading.empty() ? "" : section.heading + "  ",
                       section.summary);
    AddText(*section.keys, "", out);
    out += "\n";
  }
  return out;
}

std::string KeysAsMarkdown() {
  std::string out;
  for (const Section& section : AllSections()) {
    const std::string heading = section.heading.empty() ? "The file" : "`" + section.heading + "`";
    out += fmt::format("### {}: {}\n\n", heading, section.summary);
    if (section.keys->keys().empty()) {
      out += "No keys.\n\n";
    } else {
      out += "| key | form | unit | default | meaning |\n|---|---|---|---|---|\n";
      AddMarkdown(*section.keys, "", out);
      out += "\n";
    }
    if (!section.keys->example().empty() || section.heading.starts_with("[effects")) {
      out += fmt::format("```toml\n{}{}```\n\n",
                         section.heading.empty() || section.keys->example().starts_with("[[")
                             ? ""
                             : section.heading + "\n",
                         section.keys->example());
    }
  }
  return out;
}

std::string KeysAsJsonSchema() {
  const std::vector<Section> sections = AllSections();
  Json schema = EmptyTable();
  schema["$schema"] = "http://json-schema.org/draft-07/schema#";
  schema["title"] = "Torquer scene";
  schema["required"] = Json::array({"vessel", "entry", "instrument"});
  AddKeys(KeysOf(sections, ""), schema);
  schema["properties"]["vessel"] = VesselSchema(sections);
  for (const char* name : {"case", "patient_axes", "entry", "relaxation"}) {
    schema["properties"][name] = SchemaOf(KeysOf(sections, name));
  }
  schema["properties"]["instrument"] = {{"type", "array"},
                                        {"items", SchemaOf(KeysOf(sections, "instrument"))},
                                        {"minItems", 1},
                                        {"maxItems", kMostInstruments}};
  Json effects = EmptyTable();
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    Json one = SchemaOf(*kind.keys.table);
    one["description"] = kind.summary;
    effects["properties"][kind.name] = std::move(one);
    if (!kind.needs.empty()) effects["dependencies"][kind.name] = Json::array({kind.needs});
  }
  schema["properties"]["effects"] = std::move(effects);
  return schema.dump(2) + "\n";
}

}  // namespace torquer::scene
