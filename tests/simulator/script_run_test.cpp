#include "host/simulator/script_run.h"

#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "host/support/error.h"
#include "tests/simulator/scenes.h"
#include "tests/support/child_process.h"

using Catch::Matchers::Contains;
using torquer::test::ChildProcess;
using torquer::test::SceneFile;

namespace {

constexpr char kHeader[] = "time_s,insertion_mm,rotation_rad\n";

void Write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

}  // namespace

TEST_CASE("A script gives one JSON object a row, absolute since the start", "[simulator]") {
  const SceneFile file(torquer::test::kFriction);
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,0,0\n0.001,0.5,0\n0.002,1.25,0.3\n");
  torquer::scene::Scene scene(file.path());
  CHECK(torquer::simulator::RunScript(scene, file.Beside("s.csv"), {file.Beside("s.jsonl"), ""}) ==
        0);
  std::ifstream in(file.Beside("s.jsonl"));
  std::vector<nlohmann::json> rows;
  for (std::string line; std::getline(in, line);) rows.push_back(nlohmann::json::parse(line));
  REQUIRE(rows.size() == 3);
  CHECK(rows[2]["time_s"] == 0.002);
  CHECK(rows[2]["insertion_mm"] == 121.25);
  CHECK(rows[2]["rotation_rad"] == 0.3);
  CHECK(rows[2]["nodes_mm"].size() == 122);
  CHECK(rows[2]["residual"].get<double>() <= 1e-6);
  CHECK(rows[2]["iterations"].get<int>() > 0);
  for (const char* key : {"energy_mJ", "max_penetration_um", "solve_us", "status"}) {
    CHECK(rows[2][key].is_number());
  }
}

TEST_CASE("A bad script is refused and leaves nothing behind", "[simulator]") {
  const SceneFile file;
  torquer::scene::Scene scene(file.path());
  const auto refuse = [&](const std::string& text, const std::string& said) {
    Write(file.Beside("s.csv"), text);
    CHECK_THROWS_WITH(
        torquer::simulator::RunScript(scene, file.Beside("s.csv"), {file.Beside("s.jsonl"), ""}),
        Contains(said));
    CHECK_FALSE(std::filesystem::exists(file.Beside("s.jsonl")));
    CHECK_FALSE(std::filesystem::exists(file.Beside("s.jsonl.part")));
  };
  refuse("time,insertion\n", "s.csv:1");
  refuse(std::string(kHeader) + "0,0,0\n1,nan,0\n", "s.csv:3: insertion_mm is 'nan'");
  refuse(std::string(kHeader) + "1,0,0\n1,0,0\n", "s.csv:3: time_s is 1");
}

TEST_CASE("The program ends with 2 and a sentence on what it cannot use", "[simulator]") {
  const std::string program = std::string(TORQUER_BIN_DIR) + "/torquer-simulator";
  const SceneFile file;
  const auto refuse = [&](const std::vector<std::string>& words, const std::string& said) {
    std::vector<std::string> all = {program};
    all.insert(all.end(), words.begin(), words.end());
    ChildProcess child(all);
    CHECK(child.Wait() == 2);
    CHECK_THAT(child.Error(), Contains("torquer-simulator: ") && Contains(said));
  };
  refuse({}, "--scene is missing");
  refuse({"--scene"}, "--scene needs a value");
  refuse({"--sceen", "x"}, "--sceen");
  refuse({"--scene", "no/such.toml"}, "no/such.toml");
  refuse({"--scene", file.path(), "--script", "x"}, "--states");
  refuse({"--scene", file.path(), "--replay", "no/such.lcmlog"}, "no/such.lcmlog");
  refuse({"--scene", file.path(), "--lcm-url", "udpm://nonsense:1:2"}, "udpm://nonsense");
}
