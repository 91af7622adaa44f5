// Cases for trainees as they are shipped: what each has, and that its expert run is a good one.
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "host/recorder/expert_run.h"
#include "host/recorder/pass_marks.h"
#include "host/recorder/session_report.h"
#include "host/simulator/scene/scene.h"
#include "host/support/error.h"
#include "tests/support/paths.h"
#include "tests/support/scenes.h"

using namespace torquer;
using namespace torquer::test;

namespace {

// Scene files with a section [case].
std::vector<std::string> ShippedCases() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(SourcePath("/host/scenes"))) {
    if (entry.path().extension() != ".toml") continue;
    if (scene::ReadScene(entry.path()).training_case) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

double ReadingOf(const ExpertRun& run, const char* name) {
  return FindReading(run.readings, name).value_or(-1);
}

}  // namespace

TEST_CASE("Every shipped case has a target, friction, torsion, pass marks and an expert run") {
  const std::vector<std::string> files = ShippedCases();
  CHECK(files.size() >= 9);
  for (const std::string& file : files) {
    INFO(file);
    const scene::SceneSpec spec = scene::ReadScene(file);
    CHECK(spec.Has("assessment"));
    CHECK(spec.Has("friction"));
    CHECK(spec.Has("torsion"));
    CHECK(std::filesystem::exists(PassMarksPath(file)));
    CHECK(std::filesystem::exists(ExpertPath(file)));
  }
}

TEST_CASE("Every shipped expert run reaches its target safely, and has all pass marks") {
  int runs = 0;
  for (const std::string& file : ShippedCases()) {
    ++runs;
    INFO(file);
    scene::Scene scene(file);
    SessionReport report;
    report.scene = scene.spec().name;
    for (const auto& effect : scene.spec().effects) {
      report.description.effects.push_back(effect.name);
    }
    const ExpertRun run = RunExpert(scene, ExpertPath(file));
    CHECK(ReadingOf(run, "target_reached") == 1);
    CHECK(ReadingOf(run, "safe_success") == 1);
    CHECK(ReadingOf(run, "wrong_vessel_entries") == 0);
    report.readings = run.readings;
    MarkSheet sheet = ReadMarks(PassMarksPath(file), report);
    CompareMarks(report, sheet);
    for (const Mark& mark : sheet.marks) {
      INFO(mark.label << ": " << mark.found);
      CHECK(mark.passed == true);
    }
    if (scene.spec().Has("fluoroscopy")) CHECK(run.course.blind().path_mm < 1);
  }
  CHECK(runs >= 9);
}

TEST_CASE("An expert run has the readings and the course of its script") {
  const SceneFile file(
      "[effects.friction]\ncoefficient = 0.1\n[effects.wall_force]\nthreshold_mN = 2\n"
      "[effects.assessment]\ntarget_centerline = \"main\"\ntarget_at_mm = 140\n"
      "target_radius_mm = 5\nforce_limit_mN = 500\n");
  const std::string script = file.Beside("script.csv");
  std::ofstream(script) << "time_s,guidewire.insertion_mm,guidewire.rotation_rad,xray\n"
                           "0,0,0,0\n1,0,0.5,1\n3,20,0.5,1\n3.5,20,0.5,0\n4,15,0.5,0\n";
  scene::Scene scene(file.path());
  const ExpertRun run = RunExpert(scene, script);
  CHECK(run.file == script);
  CHECK(ReadingOf(run, "procedure_s") == Approx(4));
  CHECK(ReadingOf(run, "fluoroscopy_s") == Approx(3));
  CHECK(ReadingOf(run, "retracted_mm") == Approx(5));
  CHECK(run.course.end_s() == Approx(4));
  CHECK(run.course.xray().total_s() == Approx(3).margin(0.02));
  CHECK(run.course.blind().path_mm == Approx(5).margin(0.1));
  REQUIRE(run.course.instruments().size() == 1);
  CHECK(run.course.instruments()[0].insertion_mm.last().value == Approx(135));
  CHECK(ExpertPath("a/b.toml") == "a/experts/b.csv");
  std::ofstream(script) << "time_s,catheter.insertion_mm\n0,0\n";
  CHECK_THROWS_WITH(RunExpert(scene, script),
                    Catch::Contains(script) && Catch::Contains("catheter"));
  CHECK_THROWS_AS(RunExpert(scene, file.Beside("none.csv")), UserError);
}
