// Checks of hard cases: they detect each violation, and the torture study reports it.
#include "host/study/cases/hard_cases.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/simple_wire.h"
#include "host/study/cases/wire_invariants.h"
#include "tests/study/study_program.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wires.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;
using test::ChildProcess;
using test::LayStraight;
using test::TemporaryFolder;
using test::WithTangents;

// A wire at rest on the wall of a torus.
struct AtRest {
  AtRest() {
    newton.Restart(state);
    CountedBudget budget(100000);
    report = newton.Tick({50, 0}, budget, state);
  }
  const Torus field{Side::kInside, 30, 3};
  const WireModel model =
      MakeWire({.max_length_mm = 60, .sheath = {Vector3d(30, 0, 0), Vector3d::UnitY()}});
  const WallModel wall{.stiffness_N_mm2 = 0.01};
  const std::vector<EnergyTerm*> none;
  NewtonRelaxation newton{model, field, wall, {}, none};
  WireState state{model};
  TickReport report;
};

TEST_CASE("The wall's pressure balances the bending, and only where it does") {
  AtRest rest;
  REQUIRE(rest.report.converged);
  REQUIRE(rest.report.max_penetration_mm > 1e-4);
  CHECK(UnbalancedBend(rest.model, rest.field, rest.wall, rest.state) <=
        1.001 * rest.report.residual + 1e-9);
  const WallModel other{.stiffness_N_mm2 = 0.011};
  CHECK(UnbalancedBend(rest.model, rest.field, other, rest.state) > 1e-4);
}

TEST_CASE("A wire laid in loops comes to rest, and no step raises its energy") {
  // Without the holonomy torque, a step raised the energy in these seeds by 2.6, 1.8 and 3.4 %.
  const std::vector<HardCase> cases = HardCases();
  const auto hard = std::find_if(cases.begin(), cases.end(), [](const HardCase& one) {
    return one.name == "a start with tangents at random";
  });
  REQUIRE(hard != cases.end());
  for (const unsigned seed : {529u, 2342u, 2994u}) {
    INFO("seed " << seed);
    const HardOutcome outcome = RunHardCase(*hard, Way::kNewton, seed);
    CHECK_THAT(outcome.broken, Catch::Equals(""));
    CHECK(outcome.worst_rise <= 1e-9);
    CHECK(outcome.settled);
  }
}

TEST_CASE("A tick that lies about the wire is found out") {
  AtRest rest;
  const InstrumentPoses here{50, 0};
  const auto check = [&](const TickReport& report, const WireState& state) {
    return TickChecker(rest.model, rest.field, rest.state).Check(here, report, state, 2);
  };
  CHECK(check(rest.report, rest.state).empty());

  TickReport report = rest.report;
  report.max_penetration_mm *= 1.01;
  CHECK(check(report, rest.state).find("penetration") != std::string::npos);
  report = rest.report;
  report.carried[0].insertion_mm = 0.1;
  CHECK(check(report, rest.state).find("carried") != std::string::npos);

  // A wire whose segments are shorter by 1e-6 of their length.
  const WireModel shorter = MakeWire({.segment_mm = 1 - 1e-6});
  CHECK(check(rest.report, LayStraight(shorter, 50)).find("length") != std::string::npos);

  // The wire whips round by a quarter turn, and the report is silent about it.
  std::vector<Vector3d> tangents = rest.state.tangents();
  for (Vector3d& u : tangents) u = Vector3d(u[0], u[2], -u[1]);
  const WireState whipped = WithTangents(rest.model, rest.state, tangents);
  CHECK(check(rest.report, whipped).find("no snap was reported") != std::string::npos);
  // The report claims a snap, but nothing has moved.
  report = rest.report;
  report.snapped = true;
  CHECK(check(report, rest.state).find("a snap was reported") != std::string::npos);
}

TEST_CASE("The result of a case is compared with the limits of the case") {
  HardCase hard;
  hard.deepest_mm = 0.1;
  hard.paper.deepest_mm = 0.3;
  HardOutcome outcome;
  outcome.at_rest_mm = 0.09;
  outcome.deepest_mm = 0.29;
  outcome.settled = true;
  for (const Way way : kAllWays) CHECK(Objection(hard, way, outcome).empty());
  outcome.at_rest_mm = 0.11;
  CHECK_THAT(Objection(hard, Way::kNewton, outcome), Catch::Contains("0.11 mm deep"));
  outcome.tip_stands_off_mm = 0.02;
  CHECK(Objection(hard, Way::kNewton, outcome).empty());
  outcome.tip_stands_off_mm = 0;
  CHECK(Objection(hard, Way::kPaper, outcome).empty());
  outcome.deepest_mm = 0.31;
  CHECK_THAT(Objection(hard, Way::kPaper, outcome), Catch::Contains("0.31 mm deep"));
  outcome.unbent_mm = 0.32;
  CHECK_FALSE(Objection(hard, Way::kPaper, outcome).empty());
  hard.paper.or_unbent = true;
  CHECK(Objection(hard, Way::kPaper, outcome).empty());
  // Without its own bound, a case must not be deeper than an unbent wire.
  hard.deepest_mm.reset();
  outcome.unbent_mm = 0.12;
  CHECK(Objection(hard, Way::kNewton, outcome).empty());
  outcome.unbent_mm = 0.1;
  CHECK_FALSE(Objection(hard, Way::kNewton, outcome).empty());
  outcome.unbent_mm = 1;
  outcome.settled = false;
  CHECK_THAT(Objection(hard, Way::kNewton, outcome), Catch::Contains("does not"));
  hard.settles = false;
  CHECK(Objection(hard, Way::kNewton, outcome).empty());
  outcome.broken = "a node is lost";
  CHECK(Objection(hard, Way::kNewton, outcome) == "a node is lost");
}

TEST_CASE("Cases have names that differ, and seeds make them different") {
  std::set<std::string> names;
  const std::vector<HardCase> cases = HardCases();
  for (const HardCase& hard : cases) CHECK(names.insert(hard.name).second);
  REQUIRE(cases.back().name == "anything at random");
  std::mt19937 one(1);
  std::mt19937 again(1);
  std::mt19937 two(2);
  const double first = cases.back().make(one).model.segment_mm();
  CHECK(cases.back().make(again).model.segment_mm() == first);
  CHECK(cases.back().make(two).model.segment_mm() != first);
}

TEST_CASE("The soak has a million actions in turn and every size") {
  int most = 0;
  std::set<std::string> names;
  for (const HardCase& hard : HardCases(Extent::kSoak)) {
    names.insert(hard.name);
    if (hard.name != "full insert and retract in turn") continue;
    std::mt19937 random(1);
    most = static_cast<int>(hard.make(random).script.size());
  }
  CHECK(most == 1000000);
  for (const char* size : {"n = 1", "n = 100", "n = 1000", "n = 10000"})
    CHECK(names.contains(size));
}

TEST_CASE("torture repeats the run of a seed") {
  const TemporaryFolder folder;
  const auto rows = [&] {
    ChildProcess program({torquer::test::kStudyProgram, "torture", "--seconds", "0", "--seed", "2",
                          "--json", "--out", folder.Path("out")});
    CHECK(program.Wait() == 0);
    std::vector<std::string> lines;
    std::istringstream output(program.Output());
    for (std::string line; std::getline(output, line);) {
      const auto json = nlohmann::json::parse(line);
      CHECK(json["study"] == "torture");
      if (json["metric"] != "wall_time") lines.push_back(line);
    }
    return lines;
  };
  const std::vector<std::string> first = rows();
  CHECK(first.size() > 5);
  CHECK(rows() == first);
}

TEST_CASE("torture draws hands in the scene that --scene names") {
  const TemporaryFolder folder;
  ChildProcess program({torquer::test::kStudyProgram, "torture", "--seconds", "0", "--seed", "5",
                        "--scene", "triaxial", "--json", "--out", folder.Path("out")});
  CHECK(program.Wait() == 0);
  const std::string output = program.Output();
  CHECK(output.find("triaxial with random hands") != std::string::npos);
  CHECK(output.find("\"cases\",\"value\":1") != std::string::npos);
}

TEST_CASE("torture refuses impossible options") {
  const auto words = GENERATE(std::vector<std::string>{"--seconds", "soon"},
                              std::vector<std::string>{"--seconds", "-1"},
                              std::vector<std::string>{"--seed", "1.5"},
                              std::vector<std::string>{"--soak", "--seconds", "5"},
                              std::vector<std::string>{"--soak", "--scene", "everything"});
  std::vector<std::string> command = {torquer::test::kStudyProgram, "torture"};
  command.insert(command.end(), words.begin(), words.end());
  ChildProcess program(command);
  CHECK(program.Wait() == 2);
  CHECK(program.Error().find("--s") != std::string::npos);
}

}  // namespace
}  // namespace torquer::study
