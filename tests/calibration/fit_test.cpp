#include "calibration/fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "host/support/error.h"

namespace {

using namespace torquer::calibration;
using torquer::UserError;

constexpr double kPi = 3.14159265358979323846;

const MotionParameters kTruth{.gain_mm_per_count = 0.0215,
                              .misalignment_rad = 0.05,
                              .cylinder_radius_mm = 5.1,
                              .skew_rad = -0.01};

// The counts of a motion, not rounded.
ReferenceMotion Counted(const MotionParameters& truth, double insertion_mm, double rotation_rad) {
  const double push = truth.misalignment_rad;
  const double turn = push + truth.skew_rad;
  const double s = insertion_mm / truth.gain_mm_per_count;
  const double c = truth.cylinder_radius_mm * rotation_rad / truth.gain_mm_per_count;
  ReferenceMotion motion;
  motion.axial_counts = std::cos(push) * s - std::sin(turn) * c;
  motion.transverse_counts = std::sin(push) * s + std::cos(turn) * c;
  motion.insertion_mm = insertion_mm;
  motion.rotation_rad = rotation_rad;
  return motion;
}

// Ten strokes of 150 mm and four double turns; the reference is off as declared.
std::vector<ReferenceMotion> Session(const MotionParameters& truth, double ruler_mm,
                                     double hand_rad, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  std::vector<ReferenceMotion> motions;
  const auto add = [&](double insertion_mm, double rotation_rad) {
    ReferenceMotion motion = Counted(truth, insertion_mm + ruler_mm * normal(random),
                                     rotation_rad + hand_rad * normal(random));
    motion.insertion_mm = insertion_mm;
    motion.rotation_rad = rotation_rad;
    motion.insertion_error_mm = ruler_mm;
    motion.rotation_error_rad = hand_rad;
    motions.push_back(motion);
  };
  for (int i = 0; i < 10; ++i) add(i % 2 == 0 ? 150.0 : -150.0, 0.0);
  for (int i = 0; i < 4; ++i) add(0.0, i % 2 == 0 ? 4 * kPi : -4 * kPi);
  return motions;
}

}  // namespace

TEST_CASE("Exact references give the truth") {
  const std::vector<ReferenceMotion> motions{Counted(kTruth, 150.0, 0.0),
                                             Counted(kTruth, 0.0, 2 * kPi)};
  const MotionFit fit = FitMotion(motions, 1600);
  CHECK(fit.model.cpi == 1600);
  CHECK(fit.parameters.gain_mm_per_count == Approx(kTruth.gain_mm_per_count).epsilon(1e-10));
  CHECK(fit.parameters.misalignment_rad == Approx(kTruth.misalignment_rad).epsilon(1e-9));
  CHECK(fit.parameters.cylinder_radius_mm == Approx(kTruth.cylinder_radius_mm).epsilon(1e-10));
  CHECK(fit.parameters.skew_rad == Approx(kTruth.skew_rad).epsilon(1e-7));
  CHECK(fit.degrees_of_freedom == 0);
  CHECK(fit.chi_squared == Approx(0.0).margin(1e-12));
}

TEST_CASE("Stated 95 % intervals hold the truth in 93 to 97 % of sessions") {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  constexpr int kSessions = 2000;
  std::array<int, 4> gain_hits{};
  std::array<int, 4> parameter_hits{};
  double chi_squared = 0.0;
  for (int i = 0; i < kSessions; ++i) {
    const MotionParameters truth{.gain_mm_per_count = 0.021 * (1.0 + 0.1 * unit(random)),
                                 .misalignment_rad = 0.1 * unit(random),
                                 .cylinder_radius_mm = 5.0 + unit(random),
                                 .skew_rad = 0.02 * unit(random)};
    const MotionModel true_model = ModelOf(truth, 1200);
    const MotionFit fit = FitMotion(Session(truth, 0.5, kPi / 180.0, random), 1200);
    chi_squared += fit.chi_squared / fit.degrees_of_freedom / kSessions;
    for (std::size_t k = 0; k < 4; ++k) {
      const double off = fit.model.per_count[k / 2][k % 2] - true_model.per_count[k / 2][k % 2];
      if (std::abs(off) < kInterval95 * fit.model.standard_error[k / 2][k % 2]) ++gain_hits[k];
    }
    const auto hit = [&](double MotionParameters::*field) {
      return std::abs(fit.parameters.*field - truth.*field) <
             kInterval95 * (fit.parameter_error.*field);
    };
    parameter_hits[0] += hit(&MotionParameters::gain_mm_per_count);
    parameter_hits[1] += hit(&MotionParameters::misalignment_rad);
    parameter_hits[2] += hit(&MotionParameters::cylinder_radius_mm);
    parameter_hits[3] += hit(&MotionParameters::skew_rad);
  }
  for (std::size_t k = 0; k < 4; ++k) {
    CAPTURE(k);
    CHECK(gain_hits[k] > 0.93 * kSessions);
    CHECK(gain_hits[k] < 0.97 * kSessions);
    CHECK(parameter_hits[k] > 0.93 * kSessions);
    CHECK(parameter_hits[k] < 0.97 * kSessions);
  }
  CHECK(chi_squared == Approx(1.0).margin(0.03));
}

TEST_CASE("Residuals are reference less model, stroke by stroke") {
  std::vector<ReferenceMotion> motions;
  for (int i = 0; i < 4; ++i) {
    motions.push_back(Counted(kTruth, 100.0, 0.0));
    motions.push_back(Counted(kTruth, 0.0, 2 * kPi));
  }
  motions[2].insertion_mm += 4.0;  // one of four strokes read 4 mm too long
  const MotionFit fit = FitMotion(motions, 1200);
  REQUIRE(fit.residuals.size() == 8);
  CHECK(fit.residuals[2].insertion_mm == Approx(3.0));
  CHECK(fit.residuals[0].insertion_mm == Approx(-1.0));
  CHECK(fit.residuals[2].rotation_rad == Approx(0.0).margin(1e-12));
  CHECK(fit.chi_squared == Approx((9.0 + 3.0) / 0.25));
}

TEST_CASE("References that cannot tell are refused") {
  std::vector<ReferenceMotion> motions;
  CHECK_THROWS_WITH(FitMotion(motions, 1200), Catch::Contains("0 reference motions"));
  motions.push_back(Counted(kTruth, 150.0, 0.0));
  motions.push_back(Counted(kTruth, -140.0, 0.01));
  CHECK_THROWS_WITH(FitMotion(motions, 1200), Catch::Contains("add strokes along the axis"));
  motions.push_back(Counted(kTruth, 0.0, 2 * kPi));
  CHECK_NOTHROW(FitMotion(motions, 1200));
  motions[1].insertion_error_mm = 0.0;
  CHECK_THROWS_WITH(FitMotion(motions, 1200),
                    Catch::Contains("reference motion 2: insertion_error_mm = 0.0"));
  motions[1].insertion_error_mm = 1.0;
  motions[2].rotation_rad = std::nan("");
  CHECK_THROWS_WITH(FitMotion(motions, 1200),
                    Catch::Contains("reference motion 3: rotation_rad = nan"));
}

TEST_CASE("A joystick's center, ends and dead zone are found") {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 1.5);
  std::vector<double> at_rest;
  std::vector<double> moved;
  for (int i = 0; i < 500; ++i) {
    // A stick comes to rest a little to the side that it was let go from.
    at_rest.push_back(std::round(530.0 + (i % 2 == 0 ? 6.0 : -6.0) + noise(random)));
    moved.push_back(std::round(515.0 + 495.0 * std::sin(0.05 * i)));
  }
  const JoystickAxis axis = FitJoystickAxis(at_rest, moved, 0.5);
  CHECK(axis.center == Approx(530.0).margin(0.5));
  CHECK(axis.minimum == Approx(20.0).margin(2.0));
  CHECK(axis.maximum == Approx(1010.0).margin(2.0));
  CHECK(axis.full_rate_rad_per_s == 0.5);
  for (const double reading : at_rest) CHECK(Rate(axis, reading) == 0.0);
  CHECK(axis.dead_zone < 30.0);

  CHECK_THROWS_AS(FitJoystickAxis(at_rest, at_rest, 0.5), UserError);
  CHECK_THROWS_AS(FitJoystickAxis({}, moved, 0.5), UserError);
  CHECK_THROWS_AS(FitJoystickAxis(at_rest, {}, 0.5), UserError);
}
