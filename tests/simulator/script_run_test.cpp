#include "host/simulator/program/script_run.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/private_network.h"
#include "tests/support/scenes.h"

using Catch::Contains;
using torquer::test::ChildProcess;
using torquer::test::SceneFile;

namespace {

constexpr char kHeader[] = "time_s,guidewire.insertion_mm,guidewire.rotation_rad\n";
constexpr char kAssessed[] =
    "[effects.wall_force]\nthreshold_mN = 0.5\n"
    "[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 200\n"
    "force_limit_mN = 1\n";

void Write(const std::string& path, const std::string& text) { std::ofstream(path) << text; }

std::vector<nlohmann::json> Rows(const std::string& path) {
  std::ifstream in(path);
  std::vector<nlohmann::json> rows;
  for (std::string line; std::getline(in, line);) rows.push_back(nlohmann::json::parse(line));
  return rows;
}

}  // namespace

TEST_CASE("A stopped script ends with its rows so far", "[simulator]") {
  const SceneFile file;
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,0,0\n0.001,0.5,0\n0.002,1.25,0.3\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  const std::atomic<bool> stop = true;
  const torquer::program::ScriptResult result = torquer::program::RunScript(
      scene, file.Beside("s.csv"), {.states = file.Beside("s.jsonl")}, stop);
  CHECK(result.rows == 3);
  CHECK(result.done == 0);
  CHECK(result.end == torquer::program::ScriptEnd::kStopped);
  CHECK(std::filesystem::exists(file.Beside("s.jsonl")));
  CHECK(Rows(file.Beside("s.jsonl")).empty());
}

TEST_CASE("A script gives one JSON object a row, absolute since the start", "[simulator]") {
  const SceneFile file(torquer::test::kFriction);
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,0,0\n0.001,0.5,0\n0.002,1.25,0.3\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  CHECK(torquer::program::RunScript(scene, file.Beside("s.csv"), {file.Beside("s.jsonl"), ""})
            .unconverged == 0);
  const std::vector<nlohmann::json> rows = Rows(file.Beside("s.jsonl"));
  REQUIRE(rows.size() == 3);
  CHECK(rows[2]["time_s"] == 0.002);
  CHECK(rows[2]["guidewire.insertion_mm"] == 121.25);
  CHECK(rows[2]["guidewire.rotation_rad"] == 0.3);
  CHECK(rows[2]["guidewire.carried_mm"] == 0);
  CHECK(rows[2]["guidewire.carried_rad"] == 0);
  CHECK(rows[2]["nodes_mm"].size() == 122);
  CHECK(rows[2]["residual"].get<double>() <= 1e-6);
  CHECK(rows[2]["iterations"].get<int>() > 0);
  for (const char* key : {"energy_mJ", "max_penetration_um", "solve_us", "status"}) {
    CHECK(rows[2][key].is_number());
  }
}

TEST_CASE("States have forces only if the scene names internal_forces", "[simulator]") {
  const bool asked = GENERATE(false, true);
  const SceneFile file(std::string(torquer::test::kMicrocatheter) +
                       (asked ? "[effects.internal_forces]\n" : ""));
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,0,0\n0.001,-1,0\n0.002,0,0.3\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  torquer::program::RunScript(scene, file.Beside("s.csv"), {.states = file.Beside("s.jsonl")});
  const nlohmann::json row = Rows(file.Beside("s.jsonl"))[2];
  for (const char* key :
       {"contact_force_mN", "line_load_mN_mm", "tension_mN", "bending_mN_mm", "twisting_mN_mm"}) {
    INFO(key);
    CHECK(row.contains(key) == asked);
    if (asked) CHECK(row[key].size() == row["nodes_mm"].size());
  }
  for (const char* key : {"guidewire.hand_force_mN", "microcatheter.hand_torque_mN_mm"}) {
    CHECK(row.contains(key) == asked);
  }
  if (!asked) return;
  // Contacts and hands are in equilibrium along the entry, where the sheath reacts by bending only.
  // The bend there pushes the wire out, which adds a term.
  const double hands_mN = row["guidewire.hand_force_mN"].get<double>() +
                          row["microcatheter.hand_force_mN"].get<double>();
  double contacts_mN = 0;
  for (const nlohmann::json& force : row["contact_force_mN"]) contacts_mN += force[0].get<double>();
  const double moment = row["bending_mN_mm"][0].get<double>();
  CHECK(hands_mN == Approx(-contacts_mN - moment * moment / (2 * 16.35)).margin(1e-3));
}

TEST_CASE("Forces are null in the rows that did not converge", "[simulator]") {
  const bool converges = GENERATE(true, false);
  const SceneFile file(std::string(torquer::test::kMicrocatheter) +
                       "[effects.wall_force]\nthreshold_mN = 0.5\n[effects.internal_forces]\n"
                       "[effects.clearance]\n[effects.self_contact]\n" +
                       (converges ? "" : "[relaxation]\nbudget_units = 1\ntolerance = 1e-9\n"));
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,-1,0\n0.001,-4,0.1\n0.002,-7,0.3\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  torquer::program::RunScript(scene, file.Beside("s.csv"), {.states = file.Beside("s.jsonl")});
  for (const nlohmann::json& row : Rows(file.Beside("s.jsonl"))) {
    REQUIRE((row["status"].get<int>() & 1) == (converges ? 1 : 0));
    int forces = 0;
    for (const auto& [name, value] : row.items()) {
      const bool is_force = name == "line_load_mN_mm" || name == "tension_mN" ||
                            name == "bending_mN_mm" || name == "twisting_mN_mm" ||
                            name == "wall_line_load_mN_mm" || name == "wall_force_largest_mN" ||
                            name == "wall_force_sum_mN" || name == "wall_force_tip_mN" ||
                            name == "wall_pressure_kPa" || name == "wall_tip_pressure_kPa" ||
                            name.find("hand_") != std::string::npos ||
                            name == "lumen_force_sum_mN" || name == "lumen_force_end_mN" ||
                            name == "self_contact_force_sum_mN";
      INFO(name);
      if (is_force) {
        ++forces;
        CHECK((value.is_array() ? value[3] : value).is_null() == !converges);
      } else if (name == "contact_force_mN") {
        CHECK(value[3][0].is_null() == !converges);
      } else if (name == "energy_mJ" || name == "max_penetration_um" || name == "lumen_offset_mm") {
        CHECK(value.is_number());  // of the shape, whether it is relaxed or not
      }
    }
    CHECK(forces == 17);
  }
}

TEST_CASE("With room in a lumen states have the nodes of every instrument", "[simulator]") {
  const bool room = GENERATE(false, true);
  const SceneFile file(std::string(torquer::test::kMicrocatheter) +
                       (room ? "[effects.clearance]\n" : ""));
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,0,0\n0.001,-1,0\n0.002,0,0.3\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  torquer::program::RunScript(scene, file.Beside("s.csv"), {.states = file.Beside("s.jsonl")});
  const nlohmann::json row = Rows(file.Beside("s.jsonl"))[2];
  CHECK(row.contains("guidewire.nodes_mm") == room);
  CHECK(row.contains("lumen_offset_mm") == room);
  if (!room) return;
  CHECK(row["guidewire.nodes_mm"] == row["nodes_mm"]);
  double along_mm = 0;
  const nlohmann::json& nodes = row["microcatheter.nodes_mm"];
  for (std::size_t k = 1; k < nodes.size(); ++k) {
    along_mm += std::hypot(nodes[k][0].get<double>() - nodes[k - 1][0].get<double>(),
                           nodes[k][1].get<double>() - nodes[k - 1][1].get<double>(),
                           nodes[k][2].get<double>() - nodes[k - 1][2].get<double>());
  }
  CHECK(along_mm == Approx(row["microcatheter.insertion_mm"].get<double>()));
}

TEST_CASE("A script moves every instrument by its name", "[simulator]") {
  const SceneFile file(std::string(torquer::test::kMicrocatheter) +
                       torquer::test::kGuidingCatheter);
  // Columns in another order; values without a column stay constant.
  Write(file.Beside("s.csv"),
        "guide.insertion_mm,time_s,microcatheter.rotation_rad,guidewire.insertion_mm,"
        "microcatheter.insertion_mm\n"
        "0,0.0,0,0,0\n-1.5,0.1,-0.5,1,2\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  CHECK(torquer::program::RunScript(scene, file.Beside("s.csv"), {.states = file.Beside("s.jsonl")})
            .unconverged == 0);
  const std::vector<nlohmann::json> rows = Rows(file.Beside("s.jsonl"));
  REQUIRE(rows.size() == 2);
  const auto at = [&](const char* key) { return rows[1][key].get<double>(); };
  CHECK(at("guidewire.insertion_mm") == Approx(121));
  CHECK(at("guidewire.rotation_rad") == 0);
  CHECK(at("microcatheter.insertion_mm") == Approx(62));
  CHECK(at("microcatheter.rotation_rad") == Approx(-0.5));
  CHECK(at("guide.insertion_mm") == Approx(28.5));
  CHECK(at("guide.rotation_rad") == 0);
  for (const char* name : {"guidewire", "microcatheter", "guide"}) {
    CHECK(rows[1][std::string(name) + ".carried_mm"] == 0);
    CHECK(rows[1][std::string(name) + ".carried_rad"] == 0);
  }
}

TEST_CASE("A column of an instrument that a scene does not have is refused by name",
          "[simulator]") {
  const SceneFile file(torquer::test::kMicrocatheter);
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  const auto refuse = [&](const std::string& column, const std::vector<std::string>& said) {
    Write(file.Beside("s.csv"), "# a comment\ntime_s," + column + "\n0,0\n");
    for (const std::string& part : said) {
      CHECK_THROWS_WITH(torquer::program::RunScript(scene, file.Beside("s.csv"), {}),
                        Contains("s.csv:2: ") && Contains("small.toml") &&
                            Contains("cannot have the column " + column) && Contains(part));
    }
  };
  // The message lists the existing columns, or the nearest one.
  refuse("balloon.insertion_mm",
         {"time_s, lao_deg, cra_deg, xray, contrast, table_left_mm, table_head_mm, "
          "table_height_mm, imaging_mode, pulses_per_s, magnification, shutter_left, ",
          "injector_rise_s, guidewire.insertion_mm, guidewire.rotation_rad, "
          "guidewire.device, microcatheter.insertion_mm, microcatheter.rotation_rad, "
          "microcatheter.device"});
  refuse("guidwire.insertion_mm", {"did you mean guidewire.insertion_mm?"});
  refuse("microcatheter.rotation_deg", {"did you mean microcatheter.rotation_rad?"});
  refuse("insertion_mm", {"guidewire.insertion_mm"});
  refuse("microcatheter.", {"microcatheter.insertion_mm"});
  refuse("lao_dg", {"did you mean lao_deg?"});
}

TEST_CASE("A command beyond an instrument's length is clamped, which is reported", "[simulator]") {
  const SceneFile file(torquer::test::kMicrocatheter);
  // At the start 120 of 200 mm and 60 of 150 mm are inserted.
  Write(file.Beside("s.csv"),
        "time_s,guidewire.insertion_mm,microcatheter.insertion_mm\n0,0,0\n1,79,95\n2,70,96.5\n");
  ChildProcess child({torquer::test::ProgramPath("torquer-simulator"), "--scene", file.path(),
                      "--script", file.Beside("s.csv"), "--states", file.Beside("s.jsonl")});
  REQUIRE(child.Wait() == 0);
  CHECK_THAT(child.Error(), Contains("microcatheter is commanded to 156.5 mm past the entry point "
                                     "and is clamped to its max_length_mm, 150"));
  CHECK_THAT(child.Error(), !Contains("guidewire is commanded"));
  const std::vector<nlohmann::json> rows = Rows(file.Beside("s.jsonl"));
  REQUIRE(rows.size() == 3);
  CHECK(rows[2]["microcatheter.insertion_mm"] == 150);
  CHECK(rows[2]["microcatheter.carried_mm"] == 0);
  CHECK(rows[2]["guidewire.insertion_mm"].get<double>() == Approx(190));
}

TEST_CASE("A bad script is refused and leaves no file", "[simulator]") {
  const SceneFile file;
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  const auto refuse = [&](const std::string& text, const std::string& said) {
    Write(file.Beside("s.csv"), text);
    CHECK_THROWS_WITH(
        torquer::program::RunScript(scene, file.Beside("s.csv"), {file.Beside("s.jsonl"), ""}),
        Contains(said));
    CHECK_FALSE(std::filesystem::exists(file.Beside("s.jsonl")));
    CHECK_FALSE(std::filesystem::exists(file.Beside("s.jsonl.part")));
  };
  refuse("time,guidewire.insertion_mm\n", "s.csv:1: there is no column time_s");
  refuse("time_s,xray,xray\n", "s.csv:1: the column xray appears twice");
  refuse("time_s,xray\n0,0.5\n", "s.csv:2: xray is '0.5'; give 0 or 1");
  refuse("time_s,table_height_mm\n0,0\n1,-151\n",
         "s.csv:3: table_height_mm is '-151'; give -150 to 150");
  refuse("time_s,lao_deg\n0,0\n1,200\n", "s.csv:3: lao_deg is '200'; give -180 to 180");
  refuse(std::string(kHeader) + "0,0,0\n1,nan,0\n", "s.csv:3: guidewire.insertion_mm is 'nan'");
  refuse(std::string(kHeader) + "0,0,0\n1,1e6,0\n",
         "s.csv:3: guidewire.insertion_mm is '1e6'; give -120 to 99880");
  refuse(std::string(kHeader) + "0,0,-2e5\n",
         "s.csv:2: guidewire.rotation_rad is '-2e5'; give -100000 to 100000");
  refuse(std::string(kHeader) + "1,0,0\n1,0,0\n",
         "s.csv:3: time_s is '1', not later than the previous row");
}

TEST_CASE("A record names the scene and all that its observers found", "[simulator]") {
  const SceneFile file(kAssessed);
  Write(file.Beside("s.csv"),
        std::string(kHeader) + "0,0,0\n1,5,0\n2,20,0.3\n3,15,0.3\n4,15,0.3\n");
  Write(file.Beside("r.json"), "of an earlier session");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  torquer::program::RunScript(scene, file.Beside("s.csv"), {.record = file.Beside("r.json")});
  CHECK_FALSE(std::filesystem::exists(file.Beside("r.json.part")));
  std::ifstream in(file.Beside("r.json"));
  const nlohmann::json record = nlohmann::json::parse(in);
  CHECK(record["record_version"] == 3);
  CHECK(record["scene"] == "small");
  CHECK(record["scene_file"] == file.path());
  CHECK(record["content_hash"] == torquer::Hex(scene.content_hash()));
  CHECK(record["method"] == "newton");
  CHECK(record["effects"] == nlohmann::json({"wall_force", "assessment"}));
  CHECK(record["ticks"] == 5);
  CHECK(record["simulated_s"] == 4);
  REQUIRE(record["instruments"].size() == 1);
  CHECK(record["instruments"]["guidewire"]["insertion_mm"] == 135);
  CHECK(record["instruments"]["guidewire"]["rotation_rad"] == 0.3);
  const nlohmann::json& readings = record["readings"];
  // All measures that assess trainees.
  for (const char* name :
       {"procedure_s", "fluoroscopy_s", "tip_path_mm", "tip_path_ratio", "retractions",
        "retracted_mm", "wrong_vessel_entries", "mean_speed_mm_s", "submovements",
        "log_dimensionless_jerk", "wall_force_max_mN", "wall_impulse_mNs", "target_reached",
        "safe_success", "wall_force_sum_mN", "wall_force_largest_mN", "wall_force_events",
        "wall_force_tip_mN", "wall_force_above_s"}) {
    INFO(name);
    CHECK(readings[name].is_number());
  }
  CHECK(readings["target_reached"] == 0);
  CHECK(readings.at("target_reached_s").is_null());
  CHECK(readings["procedure_s"] == 4);
  CHECK(readings["retractions"] == 1);
  CHECK(readings["retracted_mm"] == 5);
}

TEST_CASE("A record without a converged tick has null for unknown values", "[simulator]") {
  const SceneFile file(std::string("[relaxation]\ntolerance = 1e-10\nbudget_units = 1\n") +
                       kAssessed);
  Write(file.Beside("s.csv"), std::string(kHeader) + "0,3,0\n1,9,1\n2,20,2\n");
  const torquer::Scene scene = torquer::Scene::FromFile(file.path());
  const torquer::program::ScriptResult result = torquer::program::RunScript(
      scene, file.Beside("s.csv"),
      {.states = file.Beside("s.jsonl"), .record = file.Beside("r.json")});
  REQUIRE(result.unconverged == 3);
  std::ifstream in(file.Beside("r.json"));
  const nlohmann::json readings = nlohmann::json::parse(in)["readings"];
  const nlohmann::json last = Rows(file.Beside("s.jsonl")).back();
  for (const char* name : {"wall_force_largest_ever_mN", "wall_force_max_mN", "wall_force_events",
                           "tip_path_mm", "target_reached", "safe_success"}) {
    INFO(name);
    CHECK(readings[name].is_null());
    CHECK(last[name].is_null());
  }
  CHECK(readings["wall_force_unconverged_s"] == 2);
  CHECK(readings["procedure_s"] == 2);
}

TEST_CASE("A record that cannot be is refused before the session", "[simulator]") {
  const SceneFile assessed(kAssessed);
  Write(assessed.Beside("s.csv"), std::string(kHeader) + "0,0,0\n1,5,0\n");
  const torquer::Scene scene = torquer::Scene::FromFile(assessed.path());
  const auto refuse = [&](const torquer::Scene& of, const std::string& record,
                          const std::string& said) {
    CHECK_THROWS_WITH(
        torquer::program::RunScript(of, assessed.Beside("s.csv"),
                                    {.states = assessed.Beside("s.jsonl"), .record = record}),
        Contains(said));
    CHECK_FALSE(std::filesystem::exists(assessed.Beside("s.jsonl")));
  };
  refuse(scene, assessed.Beside("no/such/r.json"), "no/such/r.json: cannot be written");
  refuse(scene, assessed.Beside(""), ": cannot be written");
  const SceneFile plain;
  const torquer::Scene without = torquer::Scene::FromFile(plain.path());
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
  // Null if the session ended before a tick has converged.
  const nlohmann::json& success = record["readings"].at("safe_success");
  CHECK((success.is_null() || success == 0));
}

TEST_CASE("The program ends with 2 and the reason for unusable input", "[simulator]") {
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
