#include "calibration/fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>

#include "host/support/error.h"
#include "tests/calibration/angles.h"
#include "tests/calibration/simulated_hand.h"

namespace {

using namespace torquer::calibration;
using torquer::UserError;
using torquer::test::ExpectationOf;
using torquer::test::GoodStrokes;
using torquer::test::HandFaults;
using torquer::test::kDegree_rad;
using torquer::test::kTurn_rad;
using torquer::test::RandomTruth;
using torquer::test::SimulatedStrokes;

constexpr int kPushes = 6;
constexpr int kTurns = 5;

const MotionParameters kTruth{.gain_mm_per_count = 0.0215,
                              .misalignment_rad = 0.05,
                              .cylinder_radius_mm = 5.1,
                              .skew_rad = -0.01};

// Counts of a motion, not rounded.
Stroke Counted(const MotionParameters& truth, double insertion_mm, double rotation_rad) {
  const double push = truth.misalignment_rad;
  const double turn = push + truth.skew_rad;
  const double s = insertion_mm / truth.gain_mm_per_count;
  const double c = truth.cylinder_radius_mm * rotation_rad / truth.gain_mm_per_count;
  Stroke stroke;
  stroke.kind = insertion_mm != 0.0 ? MotionKind::kPush : MotionKind::kTurn;
  stroke.axial_counts = std::cos(push) * s - std::sin(turn) * c;
  stroke.transverse_counts = std::sin(push) * s + std::cos(turn) * c;
  stroke.reference = insertion_mm != 0.0 ? insertion_mm : rotation_rad;
  return stroke;
}

std::vector<Stroke> Few() {
  return {Counted(kTruth, 150.0, 0.0), Counted(kTruth, 120.0, 0.0), Counted(kTruth, 0.0, kTurn_rad),
          Counted(kTruth, 0.0, 2 * kTurn_rad)};
}

// Share of confidence intervals that contain the true value.
class Coverage {
 public:
  explicit Coverage(const char* name) : name_(name) {}
  void Add(const Estimate& estimate, double truth) {
    Add(std::abs(estimate.value - truth) < estimate.HalfWidth95());
  }
  void Add(bool held) {
    held_ += held;
    ++all_;
  }
  void Check() const {
    const double share = static_cast<double>(held_) / all_;
    UNSCOPED_INFO(name_ << " is held by " << share << " of " << all_ << " intervals");
    CHECK(share > 0.93);
    CHECK(share < 0.97);
  }

 private:
  const char* name_;
  int held_ = 0;
  int all_ = 0;
};

// Motion by the model minus the true motion.
HandMotion ErrorOf(const MotionModel& model, const MotionParameters& truth, double insertion_mm,
                   double rotation_rad) {
  const Stroke stroke = Counted(truth, insertion_mm, rotation_rad);
  const Matrix2& m = model.per_count;
  return {m[0][0] * stroke.axial_counts + m[0][1] * stroke.transverse_counts - insertion_mm,
          m[1][0] * stroke.axial_counts + m[1][1] * stroke.transverse_counts - rotation_rad};
}

void CheckCoverage(const HandFaults& faults) {
  constexpr std::uint64_t kSeed = 1;
  CAPTURE(kSeed);
  std::mt19937_64 random(kSeed);
  constexpr int kRuns = 2000;
  Coverage gain("gain"), misalignment("misalignment"), radius("radius"), skew("skew"),
      push("a push"), push_turns("turning by a push"), turn("a turn"),
      turn_pushes("pushing by a turn");
  for (int i = 0; i < kRuns; ++i) {
    const MotionParameters truth = RandomTruth(random);
    const auto strokes = GoodStrokes(SimulatedStrokes(truth, faults, kPushes, kTurns, random),
                                     ExpectationOf(faults));
    const MotionFit fit = FitMotion(strokes, faults.common, 1200);
    gain.Add(fit.gain_mm_per_count, truth.gain_mm_per_count);
    misalignment.Add(fit.misalignment_rad, truth.misalignment_rad);
    radius.Add(fit.cylinder_radius_mm, truth.cylinder_radius_mm);
    skew.Add(fit.skew_rad, truth.skew_rad);
    const HandMotion pushed = ErrorOf(fit.model, truth, kFigureStrokeMm, 0.0);
    const HandMotion turned = ErrorOf(fit.model, truth, 0.0, kTurn_rad);
    push.Add(fit.push_error_mm, pushed.insertion_mm);
    push_turns.Add(fit.push_turns_rad, pushed.rotation_rad);
    turn.Add(fit.turn_error_rad, turned.rotation_rad);
    turn_pushes.Add(fit.turn_pushes_mm, turned.insertion_mm);
  }
  for (const Coverage* coverage :
       {&gain, &misalignment, &radius, &skew, &push, &push_turns, &turn, &turn_pushes}) {
    coverage->Check();
  }
}

}  // namespace

TEST_CASE("Student's t is that of the tables") {
  // Abramowitz and Stegun, table 26.10.
  CHECK(StudentHalfWidth95(1) == Approx(12.706).margin(6e-4));
  CHECK(StudentHalfWidth95(2) == Approx(4.303).margin(6e-4));
  CHECK(StudentHalfWidth95(5) == Approx(2.571).margin(6e-4));
  CHECK(StudentHalfWidth95(10) == Approx(2.228).margin(6e-4));
  CHECK(StudentHalfWidth95(120) == Approx(1.980).margin(6e-4));
  CHECK(StudentHalfWidth95(std::numeric_limits<double>::infinity()) ==
        Approx(1.95996).margin(1e-5));
  // Closed forms of one, two and four degrees of freedom (Shaw, Journal of Computational Finance
  // 9(4), 2006, 37, section 3.1).
  const double p = 0.975;
  const double alpha = 4.0 * p * (1.0 - p);
  const double q = std::cos(std::acos(std::sqrt(alpha)) / 3.0) / std::sqrt(alpha);
  CHECK(StudentHalfWidth95(1) == Approx(std::tan(std::numbers::pi * (p - 0.5))).epsilon(1e-12));
  CHECK(StudentHalfWidth95(2) == Approx((2.0 * p - 1.0) * std::sqrt(2.0 / alpha)).epsilon(1e-12));
  CHECK(StudentHalfWidth95(4) == Approx(2.0 * std::sqrt(q - 1.0)).epsilon(1e-12));
  CHECK(StudentHalfWidth95(4.5) > StudentHalfWidth95(5));
  CHECK(StudentHalfWidth95(4.5) < StudentHalfWidth95(4));
}

TEST_CASE("Exact strokes give the truth") {
  const MotionFit fit = FitMotion(Few(), {}, 1600);
  CHECK(fit.model.cpi == 1600);
  CHECK(fit.gain_mm_per_count.value == Approx(kTruth.gain_mm_per_count).epsilon(1e-10));
  CHECK(fit.misalignment_rad.value == Approx(kTruth.misalignment_rad).epsilon(1e-9));
  CHECK(fit.cylinder_radius_mm.value == Approx(kTruth.cylinder_radius_mm).epsilon(1e-10));
  CHECK(fit.skew_rad.value == Approx(kTruth.skew_rad).epsilon(1e-7));
  // The remaining error is the rounding of counts: 0.4 counts over a stroke.
  const double rounding_mm = 150.0 * std::sqrt(1.0 / 6.0) /
                             (std::hypot(150.0, 120.0) / std::sqrt(2.0)) * kTruth.gain_mm_per_count;
  CHECK(fit.push_error_mm.standard_error == Approx(rounding_mm).epsilon(0.01));
  CHECK(fit.push_declared_share == Approx(1.0));
}

TEST_CASE("Stated 95 % intervals hold the truth in 93 to 97 % of runs") {
  HandFaults faults;
  SECTION("with a ruler read for each stroke") { faults.push_mm = 0.5; }
  SECTION("between end stops whose distance was measured once, and with a hand of habits") {
    faults.push_mm = 0.1;
    faults.common = {.push_mm = 0.5,
                     .push_turn_rad = 0.5 * kDegree_rad,
                     .turn_rad = 1.0 * kDegree_rad,
                     .turn_push_mm = 0.3};
  }
  SECTION("with a hand much worse than it is declared to be") {
    faults.push_turn_rad = 3.0 * kDegree_rad;
    faults.turn_push_mm = 2.0;
  }
  CheckCoverage(faults);
}

TEST_CASE("With exact references gain, misalignment and rotation are found closely") {
  constexpr std::uint64_t kSeed = 12;
  CAPTURE(kSeed);
  std::mt19937_64 random(kSeed);
  double gain = 0.0, misalignment_deg = 0.0, rotation_deg = 0.0;
  for (int i = 0; i < 1000; ++i) {
    const MotionParameters truth = RandomTruth(random);
    const HandFaults faults = HandFaults::None();
    const auto strokes = GoodStrokes(SimulatedStrokes(truth, faults, kPushes, kTurns, random),
                                     ExpectationOf(faults));
    REQUIRE(strokes.size() == kPushes + kTurns);
    const MotionFit fit = FitMotion(strokes, {}, 1200);
    const auto grow = [](double& largest, double off) {
      largest = std::max(largest, std::abs(off));
    };
    grow(gain, fit.gain_mm_per_count.value / truth.gain_mm_per_count - 1.0);
    grow(misalignment_deg, (fit.misalignment_rad.value - truth.misalignment_rad) / kDegree_rad);
    grow(rotation_deg, ErrorOf(fit.model, truth, 0.0, kTurn_rad).rotation_rad / kDegree_rad);
  }
  CHECK(gain < 0.001);
  CHECK(misalignment_deg < 0.05);
  CHECK(rotation_deg < 0.2);
}

TEST_CASE("Residuals are reference less model, stroke by stroke") {
  std::vector<Stroke> strokes;
  for (int i = 0; i < 4; ++i) {
    strokes.push_back(Counted(kTruth, 100.0, 0.0));
    strokes.push_back(Counted(kTruth, 0.0, kTurn_rad));
  }
  strokes[2] = Counted(kTruth, 96.0, 0.0);  // one of four pushes stopped 4 mm short
  strokes[2].reference = 100.0;
  const MotionFit fit = FitMotion(strokes, {}, 1200);
  REQUIRE(fit.residuals.size() == 8);
  CHECK(fit.residuals[2].insertion_mm == Approx(100.0 - 96.0 / 0.99));
  CHECK(fit.residuals[0].insertion_mm == Approx(100.0 - 100.0 / 0.99));
  CHECK(fit.residuals[2].rotation_rad == Approx(0.0).margin(1e-12));
  CHECK(fit.push_scatter.insertion_mm == Approx(2.0 / 0.99));
  CHECK(fit.push_error_mm.degrees_of_freedom == Approx(3.0).epsilon(1e-3));
  CHECK(fit.push_error_mm.standard_error == Approx(1.5 * 1.0 / 0.99).epsilon(1e-3));
}

TEST_CASE("A stroke weighs by its declared error") {
  std::vector<Stroke> strokes = Few();
  strokes[0].axial_counts *= 1.1;
  strokes[0].transverse_counts *= 1.1;
  strokes[0].reference_error = 1e3;
  const MotionFit fit = FitMotion(strokes, {}, 1200);
  CHECK(fit.gain_mm_per_count.value == Approx(kTruth.gain_mm_per_count).epsilon(1e-5));
}

TEST_CASE("Strokes without enough information are refused") {
  CHECK_THROWS_WITH(FitMotion({}, {}, 1200), Catch::Contains("0 pushes"));
  std::vector<Stroke> strokes{Few()[0], Few()[1], Few()[2]};
  CHECK_THROWS_WITH(FitMotion(strokes, {}, 1200), Catch::Contains("1 turns"));
  strokes = Few();
  for (Stroke& stroke : strokes) stroke.transverse_counts = 0.0;
  CHECK_THROWS_WITH(FitMotion(strokes, {}, 1200), Catch::Contains("the same way"));
  strokes = Few();
  strokes[1].reference_error = 0.0;
  CHECK_THROWS_WITH(FitMotion(strokes, {}, 1200),
                    Catch::Contains("stroke 2: reference_error = 0; give"));
  strokes = Few();
  strokes[2].axial_counts = std::nan("");
  CHECK_THROWS_WITH(FitMotion(strokes, {}, 1200), Catch::Contains("stroke 3: axial_counts = nan"));
  strokes = Few();
  strokes[3].reference = 0.0;
  CHECK_THROWS_WITH(FitMotion(strokes, {}, 1200), Catch::Contains("stroke 4: reference = 0; give"));
  CHECK_THROWS_WITH(FitMotion(Few(), {.push_mm = -1.0}, 1200),
                    Catch::Contains("common error push_mm = -1; give"));
}

TEST_CASE("A joystick's center, ends and dead zone are found") {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0.0, 1.5);
  std::vector<double> at_rest;
  std::vector<double> moved;
  for (int i = 0; i < 500; ++i) {
    // A released stick comes to rest a little to the side that it was released from.
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
