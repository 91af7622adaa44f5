// Measures of the accuracy study: distances between wires of different segments, basins and
// residuals. Also the field that is only continuous, and one complete case.
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "host/simulator/vessel/phantoms.h"
#include "host/study/accuracy_bench.h"
#include "host/study/accuracy_grid.h"
#include "host/study/accuracy_report.h"
#include "host/study/cases/analytic_fields.h"
#include "host/study/cases/simple_wire.h"
#include "host/study/trilinear_field.h"
#include "host/study/wire_comparison.h"
#include "tests/support/child_process.h"
#include "tests/support/paths.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/wires.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

const std::string kScenes = torquer::test::SourcePath("/host/scenes");

// Points of a circle of radius 50 mm that starts at the origin along x.
std::vector<Vector3d> Circle() {
  std::vector<Vector3d> path;
  for (double s = 0.01; s < 60; s += 0.01) {
    path.emplace_back(50 * std::sin(s / 50), 50 * (1 - std::cos(s / 50)), 0);
  }
  return path;
}

WireState LaidAlong(const WireModel& model, const std::vector<Vector3d>& path, double length_mm) {
  return WireState::Along(model, path, {length_mm, 0});
}

TEST_CASE("A wire recut in other segments is the same wire") {
  const WireModel fine = MakeWire({.segment_mm = 0.1});
  const WireModel coarse = MakeWire({.segment_mm = 1});
  WireState from = LaidAlong(fine, Circle(), 40);
  from.Rotate(0.7);
  const WireState to = Recut(coarse, from);
  CHECK(to.segments() == 40);
  CHECK(to.insertion_mm() == 40);
  CHECK(to.rotation_rad() == 0.7);
  // A chord of 1 mm deviates from a circle of 50 mm by 2.5 um. All chords together are 0.7 um too
  // short.
  CHECK(Compare(fine, from, coarse, to).max_mm < 0.004);
  CHECK(Compare(fine, from, coarse, to).mean_mm > 1e-5);
}

TEST_CASE("Distances are of material points, from the tip") {
  const WireModel model = MakeWire({});
  const WireState straight = LaidAlong(model, {}, 40);
  const WireState longer = LaidAlong(model, {}, 42);
  CHECK(Compare(model, straight, model, straight).max_mm == 0);
  CHECK(Compare(model, straight, model, longer).mean_mm == Approx(2));
  CHECK(Compare(model, straight, model, longer).max_mm == Approx(2));
}

TEST_CASE("Penetration is found between the nodes too") {
  const WireModel model = MakeWire({.segment_mm = 2});
  WireState state = LaidAlong(model, {}, 4);
  // A wall that touches the middle of the second segment only: the wire leaves a post.
  const Cylinder post(Side::kOutside, Vector3d(3, 1, 0), Vector3d::UnitZ(), 1);
  CHECK(DeepestPenetration(model, post, state) == Approx(0.178).margin(1e-3));
}

TEST_CASE("The residual a length does not depend on the segments") {
  // A straight wire under an unbalanced transverse load: pressed into a plane.
  const HalfSpace floor(Vector3d(0, -0.1, 0), Vector3d::UnitY());
  const std::vector<EnergyTerm*> none;
  std::vector<double> residuals;
  std::vector<double> usual;
  for (const double segment_mm : {1.0, 0.25}) {
    const WireModel model = MakeWire({.segment_mm = segment_mm});
    const WallModel wall{.stiffness_N_mm2 = 0.01};
    WireMechanics mechanics(model, floor, wall, none);
    QuadraticModel quadratic = mechanics.MakeQuadraticModel();
    WireState state = LaidAlong(model, {}, 40);
    state.UntwistFrames(model);
    mechanics.BuildGradient(state, quadratic);
    residuals.push_back(ResidualPerLength(model, state, quadratic.gradient));
    usual.push_back(quadratic.residual);
  }
  CHECK(residuals[1] == Approx(residuals[0]).epsilon(0.05));
  CHECK(usual[1] < 0.3 * usual[0]);
}

TEST_CASE("A wire in another branch is distinguished from one that is merely off") {
  const vessel::TubeVessel vessel = vessel::MakeTyPhantom();
  const auto branch = [&](std::size_t curve) {
    std::vector<Vector3d> path;
    const auto& centerline = vessel.centerlines.curves()[curve];
    for (double s = 0.5; s < centerline.length_mm(); s += 0.5) {
      path.push_back(centerline.At(s).position_mm);
    }
    return path;
  };
  const WireModel model = MakeWire(
      {.max_length_mm = 150, .sheath = {vessel.entry_point_mm(), vessel.entry_direction()}});
  const WallModel wall{.stiffness_N_mm2 = 0.01};
  const WireState here = LaidAlong(model, branch(0), 125);
  // The stem, then the other arm of the T.
  std::vector<Vector3d> detour;
  for (double s = 0.5; s <= 100; s += 0.5) detour.emplace_back(s, 0, 0);
  const std::vector<Vector3d> side = branch(1);
  detour.insert(detour.end(), side.begin(), side.end());
  const WireState there = LaidAlong(model, detour, 125);
  REQUIRE(Compare(model, here, model, there).max_mm > 20);
  CHECK_FALSE(InOneBasin(model, *vessel.field, wall, here, there, 0.5));

  std::vector<Vector3d> tangents = here.tangents();
  for (std::size_t i = 0; i < tangents.size(); ++i) {
    tangents[i] = (tangents[i] + (i % 7 < 3 ? 0.02 : -0.015) * here.normals()[i]).normalized();
  }
  const WireState off = test::WithTangents(model, here, tangents);
  REQUIRE(Compare(model, here, model, off).max_mm > 0.05);
  CHECK(InOneBasin(model, *vessel.field, wall, here, off, 0.5));
}

TEST_CASE("The linear field is exact on its grid, and its derivatives are its own") {
  const Torus smooth(Side::kInside, 20, 4);
  const TrilinearField field(smooth, 0.5);
  const Vector3d node(-20.5, 1.5, -2);
  CHECK(field.Clearance(node) == Approx(smooth.Clearance(node)).margin(1e-6));
  const Vector3d at(-18.87, 3.21, 1.12);
  CHECK(std::abs(field.Clearance(at) - smooth.Clearance(at)) < 0.03);
  ClearanceSample sample;
  field.EvaluateHessian(at, sample);
  CHECK(sample.clearance_mm == field.Clearance(at));
  constexpr double kStep = 1e-4;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = kStep * Vector3d::Unit(axis);
    ClearanceSample plus;
    ClearanceSample minus;
    field.EvaluateGradient(at + step, plus);
    field.EvaluateGradient(at - step, minus);
    CHECK(sample.gradient[axis] ==
          Approx((plus.clearance_mm - minus.clearance_mm) / (2 * kStep)).margin(1e-8));
    const Vector3d slope = (plus.gradient - minus.gradient) / (2 * kStep);
    CHECK((sample.hessian.col(axis) - slope).norm() < 1e-8);
  }
}

TEST_CASE("A case is measured against its reference") {
  AccuracyBench::Options options;
  options.reference_segment_mm = 0.5;
  AccuracyBench bench(kScenes + "/ty_phantom.toml", {100}, options);
  AccuracyCase setting = DefaultCase();
  const AccuracyOutcome usual = bench.Measure(setting);
  CHECK(bench.reference_unconverged() == 0);
  CHECK(usual.places == 1);
  CHECK(usual.action_ms.size() == 100);
  CHECK(usual.fed_mm == 10);
  CHECK(usual.unconverged == 0);
  CHECK(usual.basin_changes == 0);
  CHECK(usual.residual <= 1e-6);
  CHECK(usual.Quantile(0.5) <= usual.Quantile(0.99));
  CHECK(usual.error_mean_mm > 1e-4);
  CHECK(usual.error_mean_mm < 0.1);
  CHECK(usual.solver_error_max_mm < 1e-3);

  // The reference's own setting has zero error.
  setting.segment_mm = 0.5;
  setting.tolerance = 1e-9;
  const AccuracyOutcome same = bench.Measure(setting);
  CHECK(same.error_max_mm < 1e-6);
  CHECK(std::abs(same.energy_gap) < 1e-9);

  AccuracyCase paper;
  paper.method = AccuracyMethod::kPaper;
  paper.cycles = PaperCycles::kPhysical;
  paper.cycle_count = 1;
  paper.law = BendingLaw::kG1;
  paper.contact_points = 1;
  const AccuracyOutcome literal = bench.Measure(paper);
  CHECK(literal.action_ms.size() == 10);
  CHECK(literal.error_mean_mm + literal.basin_changes > 2 * usual.error_mean_mm);
}

TEST_CASE("The front has the points that no other point beats in both") {
  const std::vector<FrontPoint> front = ParetoFront(
      {{"slow", "", 10, 0.01}, {"fast", "", 1, 1}, {"beaten", "", 11, 0.02}, {"mid", "", 3, 0.1}});
  REQUIRE(front.size() == 3);
  CHECK(front[0].name == "fast");
  CHECK(front[1].name == "mid");
  CHECK(front[2].name == "slow");
}

TEST_CASE("The report begins with the front, the default marked on it") {
  std::map<std::string, MeasuredCases> measured;
  double ms = 1;
  for (const AccuracyCase& setting : FrontCases(true)) {
    AccuracyOutcome outcome;
    outcome.action_ms = {ms, 2 * ms};
    outcome.fed_mm = 10;
    outcome.places = 1;
    outcome.error_mean_mm = outcome.error_max_mm = 1 / ms;
    outcome.solver_error_mean_mm = setting.tolerance;
    measured["one"].emplace(setting.name, Measured{setting, outcome});
    ms *= 1.1;
  }
  // The other scene has only the default: it alone appears in the combined picture.
  measured["two"].emplace("default", measured["one"].at("default"));
  const test::TemporaryFolder folder;
  StudyRun::Options options;
  options.folder = folder.Path("results");
  options.json = true;
  StudyRun run("accuracy", options);
  ReportAccuracy(run, {{}, measured, {{"paper/segment=0.4mm/pr=3", {"one"}}}});
  run.Finish("Title");
  std::ifstream file(folder.Path("results/accuracy.html"));
  std::stringstream html;
  html << file.rdbuf();
  const std::string text = html.str();
  const std::size_t first = text.find("<svg ");
  REQUIRE(first != std::string::npos);
  const std::string picture = text.substr(first, text.find("</svg>", first) - first);
  CHECK(picture.find("Error against time, over all scenes") != std::string::npos);
  CHECK(picture.find(">default</text>") != std::string::npos);
  CHECK(picture.find("paper/") == std::string::npos);
  CHECK(text.find("paper/segment=0.4mm/pr=3 (one)") != std::string::npos);
  bool recorded = false;
  for (const ResultRow& row : run.rows()) recorded = recorded || row.case_name == "front/default";
  CHECK(recorded);
}

TEST_CASE("A folder without the scenes is refused") {
  const test::TemporaryFolder folder;
  const std::string study = GENERATE("accuracy", "scaling");
  const std::string torquer_study = torquer::test::ProgramPath("torquer-study");
  test::ChildProcess program(
      {torquer_study, study, "--scenes", folder.Path("none"), "--out", folder.Path("out")});
  CHECK(program.Wait() == 2);
  CHECK(program.Error().find("--scenes") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(folder.Path("out")));
}

}  // namespace
}  // namespace torquer::study
