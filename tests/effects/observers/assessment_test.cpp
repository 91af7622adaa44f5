#include "host/simulator/effects/observers/assessment.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <string>

#include "host/simulator/vessel/moving_field.h"
#include "host/simulator/vessel/phantoms.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A tip that the test positions, on a route of 100 mm along +x with radius 4 mm. The vessel of the
// target runs on for 60 mm; a branch leaves the route along +y at 50 mm.
struct Trainee {
  explicit Trainee(const vessel::MovingField* vessel = nullptr) : moving(vessel) {
    report.converged = true;
  }

  const vessel::MovingField* moving;
  vessel::CenterlineNetwork vessels{
      {vessel::Centerline("trunk", {{0, 0, 0}, {50, 0, 0}, {160, 0, 0}}, {4, 4, 4}),
       vessel::Centerline("branch", {{50, 0, 0}, {50, 60, 0}}, {3, 3})}};
  effects::WallForce force{{.threshold_mN = 100}};
  WireModel model = MakeWire({});
  effects::Assessment assessment{
      {.route = vessel::Centerline("route", {{0, 0, 0}, {50, 0, 0}, {100, 0, 0}}, {4, 4, 4}),
       .vessels = vessels,
       .target = {0, 100},
       .target_radius_mm = 3,
       .force_limit_mN = 50},
      force,
      model,
      moving};
  WireState state{model};
  QuadraticModel quadratic;
  TickReport report;
  effects::Controls controls;
  InstrumentPoses target;
  double time_s = 0;

  void PutAt(const Vector3d& tip, double insertion_mm) {
    state = WireState(MakeWire({.sheath = {tip, Vector3d::UnitX()}}));
    target[0].insertion_mm = insertion_mm;
  }

  void Go(const Vector3d& tip, double insertion_mm, double seconds) {
    const Vector3d from = state.nodes().back();
    const double begin_mm = target[0].insertion_mm;
    const int steps = static_cast<int>(std::lround(seconds / 0.005));
    for (int k = 1; k <= steps; ++k) {
      const double part = static_cast<double>(k) / steps;
      // A wire of zero length has its tip at the sheath.
      const Vector3d at = from + part * (tip - from);
      state = WireState(MakeWire({.sheath = {at, Vector3d::UnitX()}}));
      target[0].insertion_mm = begin_mm + part * (insertion_mm - begin_mm);
      time_s += 0.005;
      const effects::TickView tick{.time_s = time_s,
                                   .step_s = 0.005,
                                   .controls = controls,
                                   .target = target,
                                   .state = state,
                                   .quadratic = quadratic,
                                   .report = report};
      force.Observe(tick);
      assessment.Observe(tick);
    }
  }
  double operator[](const std::string& name) const {
    std::map<std::string, double> all;
    for (const effects::Reading& reading : assessment.Readings()) all[reading.name] = reading.value;
    REQUIRE(all.count(name) == 1);
    return all[name];
  }
};

TEST_CASE("Straight to the target: path ratio one, no retraction, reached and safe") {
  Trainee trainee;
  trainee.Go({100, 0, 0}, 100, 10);
  CHECK(trainee["procedure_s"] == Approx(10));
  CHECK(trainee["tip_path_ratio"] == Approx(1).epsilon(0.01));
  CHECK(trainee["retractions"] == 0);
  CHECK(trainee["wrong_vessel_entries"] == 0);
  CHECK(trainee["target_reached"] == 1);
  CHECK(trainee["target_reached_s"] == Approx(9.7).margin(0.05));
  CHECK(trainee["safe_success"] == 1);
  CHECK(trainee["mean_speed_mm_s"] == Approx(10).epsilon(0.02));
}

TEST_CASE("The path ratio counts the route from the place where the tip starts") {
  Trainee trainee;
  trainee.PutAt({60, 0, 0}, 60);
  trainee.Go({100, 0, 0}, 100, 4);
  CHECK(trainee["tip_path_mm"] == Approx(40).epsilon(0.02));
  CHECK(trainee["tip_path_ratio"] == Approx(1).epsilon(0.02));
  trainee.assessment.Restart();
  trainee.PutAt({20, 0, 0}, 20);
  trainee.Go({100, 0, 0}, 100, 8);
  CHECK(trainee["tip_path_ratio"] == Approx(1).epsilon(0.02));
}

TEST_CASE("A tip that starts in another vessel has the way to the route in addition") {
  Trainee trainee;
  trainee.PutAt({60, 24, 0}, 0);
  trainee.Go({60, 4, 0}, 20, 2);
  trainee.Go({100, 4, 0}, 60, 4);
  CHECK(trainee["tip_path_ratio"] == Approx(1).epsilon(0.02));
}

TEST_CASE("A session that starts at the target has no path ratio") {
  Trainee trainee;
  trainee.PutAt({98, 0, 0}, 98);
  trainee.Go({100, 0, 0}, 100, 1);
  CHECK(std::isnan(trainee["tip_path_ratio"]));
}

// Moves the whole vessel sideways.
class Aside final : public vessel::FieldMotion {
 public:
  void SetTime(double time_s) override { shift_mm_ = 12 * std::sin(time_s); }
  void AddOffset(const Eigen::Vector3d&, vessel::Offset& offset) const override {
    offset.value[1] += shift_mm_;
  }
  double TravelMm() const override { return 12; }
  double LastTravelMm() const override { return 12; }
  double LargestStretch() const override { return 0; }

 private:
  double shift_mm_ = 0;
};

TEST_CASE("A tip that moves with its vessel has no path and leaves no route") {
  const FreeSpace field;
  Aside aside;
  vessel::MovingField moving(field);
  moving.Add(aside);
  Trainee trainee(&moving);
  for (int k = 1; k <= 200; ++k) {
    moving.SetTime(0.02 * k);
    trainee.Go({40, 12 * std::sin(0.02 * k), 0}, 40, 0.005);
  }
  CHECK(trainee["wrong_vessel_entries"] == 0);
  CHECK(trainee["tip_path_mm"] == Approx(0).margin(1e-9));
}

TEST_CASE("A detour into another vessel and back is counted once, with its path") {
  Trainee trainee;
  trainee.Go({50, 0, 0}, 50, 5);
  trainee.Go({50, 20, 0}, 70, 2);  // off the route, 16 mm outside its wall
  trainee.Go({50, 0, 0}, 50, 2);   // and back
  trainee.Go({90, 0, 0}, 90, 4);
  CHECK(trainee["wrong_vessel_entries"] == 1);
  CHECK(trainee["retractions"] == 1);
  CHECK(trainee["retracted_mm"] == Approx(20));
  CHECK(trainee["tip_path_mm"] == Approx(130).epsilon(0.02));
  CHECK(trainee["target_reached"] == 0);
  CHECK(std::isnan(trainee["target_reached_s"]));
}

TEST_CASE(
    "A wrong vessel counts from 5 mm of depth, and once until the tip is on the route again") {
  Trainee trainee;
  trainee.Go({50, 0, 0}, 50, 5);
  // The branch leaves the lumen of the route 4 mm from its middle.
  trainee.Go({50, 8.5, 0}, 58.5, 2);
  CHECK(trainee["wrong_vessel_entries"] == 0);
  for (int k = 0; k < 5; ++k) {
    trainee.Go({50, 5, 0}, 55, 0.5);
    trainee.Go({50, 9.5, 0}, 59.5, 0.5);
  }
  CHECK(trainee["wrong_vessel_entries"] == 1);
  trainee.Go({50, 2, 0}, 52, 1);
  trainee.Go({50, 15, 0}, 65, 1);
  CHECK(trainee["wrong_vessel_entries"] == 2);
}

TEST_CASE(
    "A wide place of the route and the vessel beyond the target do not count as wrong vessels") {
  Trainee trainee;
  trainee.Go({20, 0, 0}, 20, 2);
  trainee.Go({20, 11, 0}, 31, 1);  // 7 mm beyond the radius, but in no other vessel
  trainee.Go({20, 0, 0}, 20, 1);
  trainee.Go({130, 0, 0}, 130, 8);
  CHECK(trainee["target_reached"] == 1);
  CHECK(trainee["wrong_vessel_entries"] == 0);
}

TEST_CASE("Tremor is neither path nor retraction") {
  Trainee trainee;
  for (int k = 0; k < 50; ++k) trainee.Go({20 + (k % 2) * 0.3, 0, 0}, 20 + (k % 2) * 0.3, 0.1);
  CHECK(trainee["retractions"] == 0);
  CHECK(trainee["tip_path_mm"] < 21);
}

TEST_CASE("The time of fluoroscopy is that with the pedal down") {
  Trainee trainee;
  trainee.controls.xray = true;
  trainee.Go({10, 0, 0}, 10, 4);
  trainee.controls = {.contrast = true};
  trainee.Go({20, 0, 0}, 20, 2);
  CHECK(trainee["fluoroscopy_s"] == Approx(4));
}

TEST_CASE("A session in which no tick converges has no result of tip or force") {
  Trainee trainee;
  trainee.report.converged = false;
  trainee.Go({100, 0, 0}, 100, 10);
  for (const char* name :
       {"tip_path_mm", "tip_path_ratio", "wrong_vessel_entries", "wall_force_max_mN",
        "wall_impulse_mNs", "target_reached", "target_reached_s", "safe_success"}) {
    INFO(name);
    CHECK(std::isnan(trainee[name]));
  }
  // The hand needs no relaxation.
  CHECK(trainee["procedure_s"] == Approx(10));
  CHECK(trainee["retractions"] == 0);
  CHECK(trainee["mean_speed_mm_s"] == Approx(10).epsilon(0.02));
}

TEST_CASE("A tick without convergence counts neither a reached target nor an entered vessel") {
  Trainee trainee;
  trainee.Go({50, 0, 0}, 50, 5);
  trainee.report.converged = false;
  trainee.Go({50, 20, 0}, 50, 1);
  trainee.Go({100, 0, 0}, 50, 1);
  trainee.Go({51, 0, 0}, 50, 1);
  trainee.report.converged = true;
  trainee.Go({60, 0, 0}, 60, 1);
  CHECK(trainee["target_reached"] == 0);
  CHECK(trainee["safe_success"] == 0);
  CHECK(trainee["wrong_vessel_entries"] == 0);
  CHECK(trainee["tip_path_mm"] == Approx(60).epsilon(0.02));
}

TEST_CASE("A tick that did not converge leaves the safety unknown, for any estimate of its force") {
  const double estimate_N = GENERATE(0.0, 0.001, 0.06);
  Trainee trainee;
  trainee.Go({50, 0, 0}, 50, 1);
  trainee.report.converged = false;
  trainee.quadratic.points = PressedPoint(estimate_N);
  trainee.Go({50, 0, 0}, 50, 0.1);
  trainee.report.converged = true;
  trainee.quadratic.points = PointSet();
  CHECK(trainee["safe_success"] == 0);  // not yet reached
  trainee.Go({100, 0, 0}, 100, 1);
  CHECK(trainee["target_reached"] == 1);
  CHECK(std::isnan(trainee["safe_success"]));
  trainee.quadratic.points = PressedPoint(0.06);
  trainee.Go({100, 0, 0}, 100, 0.1);
  CHECK(trainee["safe_success"] == 0);
}

TEST_CASE("Success above the force limit is not safe") {
  Trainee trainee;
  // One contact of 60 mN during the motion.
  trainee.quadratic.points = PressedPoint(0.06);
  trainee.Go({50, 0, 0}, 50, 1);
  trainee.quadratic.points = PointSet();
  trainee.Go({100, 0, 0}, 100, 1);
  CHECK(trainee["wall_force_max_mN"] == Approx(60));
  CHECK(trainee["target_reached"] == 1);
  CHECK(trainee["safe_success"] == 0);
}

}  // namespace
}  // namespace torquer::test
