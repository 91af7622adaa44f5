#include "host/simulator/script_run.h"

#include <catch2/catch.hpp>
#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "tests/simulator/scenes.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"

using Catch::Matchers::Contains;
using torquer::test::ChildProcess;
using torquer::test::SceneFile;

namespace {

constexpr char kHeader[] = "time_s,insertion_mm,rotation_rad\n";
constexpr char kAssessed[] =
    "[effects.wall_force]\nthreshold_mN = 0.5\n"
    "[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 200\n"
    "force_limit_mN = 1\n";

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

TEST_CASE("A script moves the catheter where there is one", "[simulator]") {
  const SceneFile file(torquer::test::kCatheter);
  Write(file.Beside("s.csv"),
        "time_s,insertion_mm,rotation_rad,catheter_insertion_mm,catheter_rotation_rad\n"
        "0.0,0,0,0,0\n0.1,1,0.1,2,-0.5\n");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::RunScript(scene, file.Beside("s.csv"), {file.Beside("s.jsonl"), ""});
  std::ifstream in(file.Beside("s.jsonl"));
  std::string line;
  std::getline(in, line);
  std::getline(in, line);
  const auto row = nlohmann::json::parse(line);
  CHECK(row["insertion_mm"].get<double>() == Approx(121));
  CHECK(row["catheter_insertion_mm"].get<double>() == Approx(62));
  CHECK(row["catheter_rotation_rad"].get<double>() == Approx(-0.5));

  const SceneFile alone;
  torquer::scene::Scene without(alone.path());
  CHECK_THROWS_WITH(torquer::simulator::RunScript(without, file.Beside("s.csv"), {}),
                    Contains("effects.catheter"));
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

TEST_CASE("A record tells of the scene and all that its observers found", "[simulator]") {
  const SceneFile file(kAssessed);
  Write(file.Beside("s.csv"),
        std::string(kHeader) + "0,0,0\n1,5,0\n2,20,0.3\n3,15,0.3\n4,15,0.3\n");
  Write(file.Beside("r.json"), "of an earlier session");
  torquer::scene::Scene scene(file.path());
  torquer::simulator::RunScript(scene, file.Beside("s.csv"), {.record = file.Beside("r.json")});
  CHECK_FALSE(std::filesystem::exists(file.Beside("r.json.part")));
  std::ifstream in(file.Beside("r.json"));
  const nlohmann::json record = nlohmann::json::parse(in);
  CHECK(record["record_version"] == 1);
  CHECK(record["scene"] == "small");
  CHECK(record["scene_file"] == file.path());
  CHECK(record["content_hash"] == torquer::Hex(scene.content_hash()));
  CHECK(record["method"] == "newton");
  CHECK(record["effects"] == nlohmann::json({"wall_force", "assessment"}));
  CHECK(record["ticks"] == 5);
  CHECK(record["simulated_s"] == 4);
  CHECK(record["insertion_mm"] == 135);
  CHECK(record["rotation_rad"] == 0.3);
  const nlohmann::json& readings = record["readings"];
  // The measures by which trainees are judged, all of them.
  for (const char* name : {"procedure_s",       "fluoroscopy_s",     "dose_proxy_mGy",
                           "contrast_mL",       "tip_path_mm",       "tip_path_ratio",
                           "retractions",       "retracted_mm",      "wrong_vessel_entries",
                           "mean_speed_mm_s",   "submovements",      "log_dimensionless_jerk",
                           "wall_force_max_mN", "wall_impulse_mNs",  "target_reached",
                           "target_reached_s",  "safe_success",      "wall_force_largest_mN",
                           "wall_force_sum_mN", "wall_force_tip_mN", "wall_force_events",
                           "wall_force_above_s"}) {
    INFO(name);
    CHECK(readings[name].is_number());
  }
  CHECK(readings["procedure_s"] == 4);
  CHECK(readings["retractions"] == 1);
  CHECK(readings["retracted_mm"] == 5);
}

TEST_CASE("A record that cannot be is refused before the session", "[simulator]") {
  const SceneFile assessed(kAssessed);
  Write(assessed.Beside("s.csv"), std::string(kHeader) + "0,0,0\n1,5,0\n");
  torquer::scene::Scene scene(assessed.path());
  const auto refuse = [&](torquer::scene::Scene& of, const std::string& record,
                          const std::string& said) {
    CHECK_THROWS_WITH(
        torquer::simulator::RunScript(of, assessed.Beside("s.csv"),
                                      {.states = assessed.Beside("s.jsonl"), .record = record}),
        Contains(said));
    CHECK_FALSE(std::filesystem::exists(assessed.Beside("s.jsonl")));
  };
  refuse(scene, assessed.Beside("no/such/r.json"), "no/such/r.json: cannot be written");
  refuse(scene, assessed.Beside(""), ": cannot be written");
  const SceneFile plain;
  torquer::scene::Scene without(plain.path());
  refuse(without, assessed.Beside("r.json"), "small.toml: has nothing to record; add [effects.");
  CHECK_FALSE(std::filesystem::exists(assessed.Beside("r.json")));
  CHECK_FALSE(std::filesystem::exists(assessed.Beside("r.json.part")));
}

TEST_CASE("Live, the record is written when the session ends", "[simulator]") {
  torquer::test::NeedPrivateNetwork();
  const std::string program = torquer::test::ProgramPath("torquer-simulator");
  const SceneFile file(kAssessed);
  ChildProcess refused({program, "--scene", file.path(), "--record", file.Beside("no/r.json")});
  CHECK(refused.Wait() == 2);
  CHECK_THAT(refused.Error(), Contains("no/r.json: cannot be written") && !Contains("running"));
  ChildProcess child({program, "--scene", file.path(), "--record", file.Beside("r.json")});
  REQUIRE(child.WaitForError("running"));
  CHECK_FALSE(std::filesystem::exists(file.Beside("r.json")));
  child.Signal(SIGTERM);
  REQUIRE(child.Wait() == 0);
  std::ifstream in(file.Beside("r.json"));
  const nlohmann::json record = nlohmann::json::parse(in);
  CHECK(record["scene"] == "small");
  CHECK(record["readings"]["safe_success"] == 0);
}

TEST_CASE("The program ends with 2 and a sentence on what it cannot use", "[simulator]") {
  const std::string program = torquer::test::ProgramPath("torquer-simulator");
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
  refuse({"--scene", file.path(), "--replay", "x", "--record", "y"}, "--record and --replay");
  refuse({"--scene", file.path(), "--replay", "no/such.lcmlog"}, "no/such.lcmlog");
  refuse({"--scene", file.path(), "--lcm-url", "udpm://nonsense:1:2"}, "udpm://nonsense");
}
