// Price list of effects: it must contain every effect with all its prices.
#include <catch2/catch.hpp>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "host/simulator/effects/effect.h"
#include "tests/study/study_program.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"

namespace torquer::study {
namespace {

using test::ChildProcess;
using test::TemporaryFolder;

TEST_CASE("The price list has every effect, the pairs of the scenes that it is given, and all") {
  const TemporaryFolder folder;
  // From scenes, only the names of their effects are read.
  std::ofstream(folder.Path("pair.toml")) << "[effects.friction]\n[effects.gravity]\n";
  std::ofstream(folder.Path("between.toml")) << "[effects.gravity]\n[effects.friction_between]\n";
  ChildProcess program(std::vector<std::string>{torquer::test::kStudyProgram, "effects", "--quick",
                                                "--json", "--scenes", folder.Path(), "--out",
                                                folder.Path("out")});
  REQUIRE(program.Wait() == 0);
  std::map<std::string, std::map<std::string, double>> prices;
  std::istringstream lines(program.Output());
  for (std::string line; std::getline(lines, line);) {
    const nlohmann::json row = nlohmann::json::parse(line);
    CHECK(row["study"] == "effects");
    prices[row["case"]][row["metric"]] = row["value"];
  }
  for (const char* body : {"model", "ct"}) {
    const auto picture = prices.extract(std::string("picture of body ") + body);
    REQUIRE(!picture.empty());
    CHECK(picture.mapped().at("moving_ms_p50") > 0);
    CHECK(picture.mapped().at("resting_ms_p50") > 0);
    // A picture of 512 x 512 is fine within 3 s of 15 pictures each second.
    CHECK(picture.mapped().at("finer_pictures") <= (std::string(body) == "ct" ? 45 : 0));
  }
  std::set<std::string> expected = {"none",
                                    "2 instruments",
                                    "2 instruments+torsion",
                                    "2 instruments+torsion+friction_between",
                                    "2 instruments+clearance",
                                    "2 instruments+torsion+clearance",
                                    "2 instruments+torsion+clearance+friction_between",
                                    "3 instruments",
                                    "3 instruments+torsion",
                                    "buddy wire",
                                    "buddy wire+torsion+friction_between",
                                    "2 instruments+friction_between+gravity",
                                    "all",
                                    "friction+gravity"};
  for (const effects::EffectKind& kind : effects::AllEffects()) {
    if (kind.name == "friction_between" || kind.name == "clearance") continue;
    if (kind.name == "patient_monitor") continue;
    if (kind.needs.empty()) expected.insert(kind.name);
  }
  expected.insert({"wall_force+assessment", "flow+contrast", "fluoroscopy+lateral_plane",
                   "flow+patient_monitor"});
  std::set<std::string> found;
  for (const auto& [name, metrics] : prices) {
    found.insert(name);
    INFO(name);
    CHECK(metrics.at("unconverged") == 0);
    CHECK(metrics.at("residual") <= 1e-6);
    CHECK(metrics.at("tick_ms_p50") > 0);
    CHECK(metrics.count("heap_bytes") == 1);
    // Instruction counts need Valgrind, a package of the tests. An effect at no extra cost is not
    // active.
    const double more = metrics.at("instructions") / prices.at("none").at("instructions");
    CHECK(metrics.at("instructions") > 1e5);
    CHECK((name == "none" || more != 1));
    CHECK((name != "all" || more > 2));
  }
  CHECK(found == expected);
}

TEST_CASE("A folder of scenes that is not there is refused") {
  ChildProcess program(std::vector<std::string>{torquer::test::kStudyProgram, "effects", "--scenes",
                                                "/nowhere/at/all"});
  CHECK(program.Wait() == 2);
  CHECK(program.Error().find("--scenes /nowhere/at/all: there is no such folder") !=
        std::string::npos);
}

}  // namespace
}  // namespace torquer::study
