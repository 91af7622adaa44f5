#include <Eigen/Core>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>

#include "host/study/experiment_data.h"
#include "host/study/experiment_rods.h"
#include "tests/study/study_program.h"
#include "tests/support/child_process.h"
#include "tests/support/temporary_folder.h"

namespace torquer::study {
namespace {

using test::ChildProcess;
using test::TemporaryFolder;

// Drop of a strip's end below its clamp in mm, from EI theta'' = -(F + w (L - s)) cos theta. At the
// clamp theta = 0, and at the end theta' = 0. Runge-Kutta steps; bisection finds the curvature at
// the clamp.
double Shoot(double rigidity_N_mm2, double weight_N_mm, double force_N) {
  constexpr int kSteps = 1000;
  constexpr double kStep = strip::kLengthMm / kSteps;
  using Eigen::Vector3d;  // theta, theta', drop
  const auto slope = [&](double s, const Vector3d& at) {
    const double beyond_N = force_N + weight_N_mm * (strip::kLengthMm - s);
    return Vector3d(at[1], -beyond_N * std::cos(at[0]) / rigidity_N_mm2, std::sin(at[0]));
  };
  const auto end = [&](double curvature) {
    Vector3d at(0, curvature, 0);
    for (int k = 0; k < kSteps; ++k) {
      const double s = k * kStep;
      const Vector3d a = slope(s, at);
      const Vector3d b = slope(s + kStep / 2, at + kStep / 2 * a);
      const Vector3d c = slope(s + kStep / 2, at + kStep / 2 * b);
      const Vector3d d = slope(s + kStep, at + kStep * c);
      at += kStep / 6 * (a + 2 * b + 2 * c + d);
    }
    return at;
  };
  double low = 0, high = 0.02;
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (end(middle)[1] > 0 ? high : low) = middle;
  }
  return end(low)[2];
}

TEST_CASE("A strip under weights bends as its differential equation has it") {
  constexpr double kRigidity = 1e3 * strip::kYoungGPa * strip::kWidthMm * strip::kThicknessMm *
                               strip::kThicknessMm * strip::kThicknessMm / 12;
  constexpr double kWeight = strip::kWeightN / strip::kLengthMm;
  for (const strip::Reading& reading : strip::kReadings) {
    INFO(reading.force_N << " N");
    const BentRod rod = Bend({strip::kLengthMm, kRigidity, kWeight, reading.force_N}, 2);
    CHECK(rod.deflection_mm ==
          Approx(Shoot(kRigidity, kWeight, reading.force_N)).epsilon(0).margin(0.05));
  }
}

TEST_CASE("A curvature at a place gives the even load and the end's deflection") {
  const ClampedRod rod{.length_mm = 90, .rigidity_N_mm2 = 6441};
  constexpr double kCurvature = 1e-6;  // so small that beams respond linearly
  const EvenLoad found = BendTo(rod, kCurvature, 20, 0.5);
  CHECK(found.rod.CurvatureAt(20) == Approx(kCurvature));
  CHECK(found.load_N_mm == Approx(2 * 6441 * kCurvature / (70 * 70)).epsilon(1e-3));
  CHECK(found.rod.deflection_mm ==
        Approx(kCurvature * std::pow(90, 4) / (4 * 70 * 70)).epsilon(1e-3));
  CHECK(found.rod.CurvatureAt(64) == Approx(kCurvature * 26 * 26 / (70 * 70)).epsilon(1e-2));
  CHECK(found.rod.CurvatureAt(90) == 0);
}

TEST_CASE("A rod between clamps gives way at four times Euler's load of pinned ends") {
  const double pi = std::numbers::pi;
  CHECK(BucklingForce(300, 5e6, 100) == Approx(4 * pi * pi * 5e6 / (300 * 300)).epsilon(1e-3));
  CHECK(BucklingForce(40, 2.5, 100) == Approx(4 * pi * pi * 2.5 / (40 * 40)).epsilon(1e-3));
}

// Values of a run by case and metric.
using Rows = std::map<std::string, std::map<std::string, double>>;

TEST_CASE("The table has published and simulated experiments with both errors") {
  const TemporaryFolder folder;
  const std::string out = folder.Path("results");
  ChildProcess program({test::kStudyProgram, "experiments", "--quick", "--json", "--out", out});
  REQUIRE(program.Wait() == 0);
  Rows rows;
  std::istringstream lines(program.Output());
  for (std::string line; std::getline(lines, line);) {
    const auto row = nlohmann::json::parse(line);
    const auto& value = row["value"];
    rows[row["case"]][row["metric"]] = value.is_null() ? std::nan("") : value.get<double>();
  }

  int compared = 0;
  for (const auto& [name, row] : rows) {
    if (!row.contains("theirs")) continue;
    INFO(name);
    CHECK(row.at("theirs") > 0);
    CHECK(row.at("ours_error") > 0);
    if (!row.contains("apart")) continue;  // this row only gives sizes
    const double stated = std::isnan(row.at("theirs_error")) ? 0 : row.at("theirs_error");
    CHECK(row.at("apart") ==
          Approx((row.at("ours") - row.at("theirs")) / std::hypot(row.at("ours_error"), stated)));
    CHECK(std::abs(row.at("apart")) < 3);
    ++compared;
  }
  CHECK(compared == 7 + 7 + 1 + 6);

  // Published measurements, as printed.
  CHECK(rows["strip/end down, 0.098 N"]["theirs"] == 149);
  CHECK(rows["columns/steel, slenderness 217"]["theirs"] == Approx(184.38).epsilon(1e-4));
  CHECK(rows["phantom/real wire; ours, 1 mm"]["theirs"] == 0.262);
  CHECK(rows["phantom/real wire; ours, 1 mm"]["theirs_error"] == 0.227);
  // The method's own error is a small part of the difference.
  CHECK(rows["phantom/ours"]["mean"] < 0.262 / 3);

  for (const char* ending : {".csv", ".jsonl", ".html", ".svg"}) {
    CHECK(std::filesystem::exists(out + "/experiments" + ending));
  }
}

}  // namespace
}  // namespace torquer::study
