// Keys of the scenes in host/scenes, one by one: read, written, read again, and refused if wrong.
#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "host/simulator/scene/scene.h"
#include "host/simulator/scene/scene_spec.h"
#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/sanitizer.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::Key;
using torquer::KeyTable;
using namespace torquer::scene;

namespace {

std::vector<std::filesystem::path> ShippedScenes() {
  std::vector<std::filesystem::path> scenes;
  for (const auto& entry :
       std::filesystem::directory_iterator(torquer::test::SourcePath("/host/scenes"))) {
    if (entry.path().extension() == ".toml") scenes.push_back(entry.path());
  }
  REQUIRE(scenes.size() >= 8);
  return scenes;
}

std::string Text(const std::filesystem::path& path) {
  std::ifstream in(path);
  return {std::istreambuf_iterator<char>(in), {}};
}

// Error message for a scene's text; "" if it is accepted.
std::string Refusal(const std::string& text, const std::filesystem::path& path) {
  try {
    ParseScene(text, path, path.parent_path());
  } catch (const torquer::UserError& error) {
    return error.what();
  }
  return "";
}

// Value in a normal form: 1, 1.0 and [1] are equal.
std::string Plain(const toml::node& node) {
  if (node.is_number()) return fmt::format("{}", *node.value<double>());
  if (const auto text = node.value_exact<std::string>()) return *text;
  if (const auto truth = node.value_exact<bool>()) return *truth ? "true" : "false";
  const toml::array* const array = node.as_array();
  REQUIRE(array != nullptr);
  std::vector<std::string> elements;
  for (const toml::node& element : *array) elements.push_back(Plain(element));
  if (elements.size() == 1) return elements[0];
  return fmt::format("[{}]", fmt::join(elements, ", "));
}

// Collects every value of a file by its place, with the index of each list's table.
void Flatten(const toml::table& table, const std::string& prefix,
             std::map<std::string, std::string>& out) {
  for (const auto& [key, node] : table) {
    const std::string place = prefix + std::string(key.str());
    const toml::array* const array = node.as_array();
    if (const toml::table* inner = node.as_table()) {
      Flatten(*inner, place + ".", out);
    } else if (array != nullptr && !array->empty() && array->front().is_table()) {
      for (std::size_t k = 0; k < array->size(); ++k) {
        Flatten(*(*array)[k].as_table(), fmt::format("{}[{}].", place, k), out);
      }
    } else {
      out[place] = Plain(node);
    }
  }
}

std::map<std::string, std::string> Values(const std::string& text) {
  std::map<std::string, std::string> values;
  Flatten(toml::parse(text), "", values);
  return values;
}

const Key* FindIn(const KeyTable& table, const std::string& place) {
  const auto dot = place.find('.');
  const std::string name = place.substr(0, std::min(dot, place.find('[')));
  for (const Key& key : table.keys()) {
    if (key.name != name) continue;
    if (dot == std::string::npos) return &key;
    return key.table == nullptr ? nullptr : FindIn(*key.table, place.substr(dot + 1));
  }
  return nullptr;
}

// Key at a place such as "instrument[0].radius_mm"; for a vessel, the key of its kind.
const Key* Find(const std::string& place, const std::string& kind) {
  for (const Section& section : AllSections()) {
    std::string prefix = section.name.empty() ? "" : section.name + ".";
    if (section.name == "vessel." + kind) prefix = "vessel.";
    if (section.name == "instrument") prefix = place.substr(0, place.find('.') + 1);
    if (section.name == "instrument" && !place.starts_with("instrument[")) continue;
    if (!place.starts_with(prefix)) continue;
    if (const Key* key = FindIn(*section.keys, place.substr(prefix.size()))) return key;
  }
  return nullptr;
}

}  // namespace

TEST_CASE("Every shipped scene is the same after it was written and read again", "[scene]") {
  for (const std::filesystem::path& path : ShippedScenes()) {
    INFO(path);
    const SceneSpec spec = ReadScene(path);
    const std::string written = WriteScene(spec);
    const SceneSpec again = ParseScene(written, "written", spec.folder);
    CHECK(WriteScene(again) == written);
    // Only keys with default values may disappear, and none is added.
    const std::map<std::string, std::string> before = Values(Text(path));
    const std::map<std::string, std::string> after = Values(written);
    for (const auto& [place, value] : before) {
      INFO(place);
      const auto found = after.find(place);
      if (found != after.end()) {
        CHECK(found->second == value);
        continue;
      }
      const Key* const key = Find(place, spec.vessel.kind);
      REQUIRE(key != nullptr);
      CHECK_FALSE(key->required);
      CHECK((key->fallback == value || key->fallback == '"' + value + '"'));
    }
    for (const auto& [place, value] : after) {
      INFO(place);
      CHECK((before.count(place) == 1 || Find(place, spec.vessel.kind)->required));
    }
  }
}

TEST_CASE("A scene that was written and read again has the same contents by its hash", "[scene]") {
  for (const std::filesystem::path& path : ShippedScenes()) {
    INFO(path);
    const SceneSpec spec = ReadScene(path);
    // Surfaces take minutes under a sanitizer.
    if (torquer::test::kUnderSanitizer && spec.vessel.kind == "surface") continue;
    const Scene scene(spec);
    const Scene again(ParseScene(WriteScene(spec), "written", spec.folder));
    CHECK(again.content_hash() == scene.content_hash());
    CHECK(again.effect_names() == scene.effect_names());
    CHECK(again.start() == scene.start());
    // Any changed key makes another scene, except the case list's entry, which is not simulated.
    SceneSpec other = spec;
    other.training_case.reset();
    CHECK(Scene(other).content_hash() == scene.content_hash());
    other.instruments.back().max_length_mm += 1;
    CHECK(Scene(other).content_hash() != scene.content_hash());
  }
}

TEST_CASE("Every section of every shipped scene refuses a key that it does not know", "[scene]") {
  for (const std::filesystem::path& path : ShippedScenes()) {
    std::vector<std::string> lines;
    std::ifstream in(path);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    const auto with = [&](std::size_t at, const std::string& line) {
      std::string text;
      for (std::size_t k = 0; k <= lines.size(); ++k) {
        if (k == at) text += line + "\n";
        if (k < lines.size()) text += lines[k] + "\n";
      }
      return text;
    };
    int sections = 0;
    bool first = true;  // true at the first key of a section
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const std::string& line = lines[k];
      INFO(path << " " << line);
      if (line.starts_with("[")) {
        ++sections;
        first = true;
        const std::string said = Refusal(with(k + 1, "qqqqqqqq = 1"), path);
        CHECK_THAT(said, Contains(fmt::format("{}:{}: ", path.string(), k + 2)) &&
                             Contains(".qqqqqqqq = 1: is not a known key; remove it"));
        continue;
      }
      const auto equals = line.find(" = ");
      if (equals == std::string::npos || line.starts_with("#") || !first) continue;
      first = false;
      // One extra letter: the message must suggest the adjacent key.
      const std::string key = line.substr(0, equals);
      const std::string said = Refusal(with(k + 1, key + "x = 1"), path);
      CHECK_THAT(said, Contains(fmt::format("{}:{}: ", path.string(), k + 2)) &&
                           Contains(key + "x = 1: is not a known key; did you mean " + key + "?"));
    }
    CHECK(sections >= 3);
  }
}

// host/demo moves every instrument of a scene.
TEST_CASE("A shipped scene has a motion for each of its instruments", "[scene]") {
  for (const std::filesystem::path& path : ShippedScenes()) {
    const SceneSpec scene = ParseScene(Text(path), path, path.parent_path());
    for (std::size_t k = 0; k < scene.instruments.size(); ++k) {
      const std::string instrument = k == 0 ? "" : "." + scene.instruments[k].name;
      const std::string motion = path.stem().string() + instrument + ".motion.csv";
      CAPTURE(motion);
      CHECK(std::filesystem::exists(path.parent_path() / motion));
    }
  }
}

TEST_CASE("A number replaces a list of one number for keys that take either", "[scene]") {
  const auto written = [](const std::string& text) {
    return WriteScene(ParseScene(text, "small.toml", {}));
  };
  int keys = 0;
  for (const Key& key : InstrumentKeys().keys()) {
    if (key.kind != torquer::KeyKind::kNumbers) continue;
    INFO(key.name);
    ++keys;
    // A second instrument with all required keys except this one.
    std::string catheter =
        "[[instrument]]\nname = \"catheter\"\nmax_length_mm = 150\ninner_radius_mm = 0.3\n";
    for (const char* other : {"radius_mm = 0.5\n", "rigidity_N_mm2 = 2\n"}) {
      if (!std::string(other).starts_with(key.name + " ")) catheter += other;
    }
    const std::string scene = torquer::test::SceneText(catheter);
    const std::string plain = written(scene + key.name + " = 0.75\n");
    CHECK_THAT(plain, Contains("\n" + key.name + " = 0.75\n"));
    CHECK(written(scene + key.name + " = [0.75]\n") == plain);
    if (key.name == "from_tip_mm") continue;
    const SceneSpec listed = ParseScene(
        scene + key.name + " = [0.75, 0.8, 0.85]\nfrom_tip_mm = [0, 10, 20]\n", "small.toml", {});
    CHECK(WriteScene(ParseScene(WriteScene(listed), "again", {})) == WriteScene(listed));
    CHECK_THAT(WriteScene(listed), Contains(key.name + " = [0.75, 0.8, 0.85]"));
    CHECK_THAT(
        Refusal(scene + key.name + " = [0.75, 0.8]\nfrom_tip_mm = [0, 10, 20]\n", "small.toml"),
        Contains("instrument[1]." + key.name) && Contains("has 2 values; give one, or one "
                                                          "for each of the 3"));
  }
  CHECK(keys == 6);
}
