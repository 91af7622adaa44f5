#include "calibration/motion_model.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "tests/calibration/angles.h"

namespace {

using namespace torquer::calibration;
using torquer::test::kTurn_rad;

}  // namespace

TEST_CASE("The counts of the nominal device for an inch are its resolution") {
  const Calibration nominal = NominalCalibration("X", 800);
  CHECK(nominal.device == "X");
  CHECK(nominal.motion.cpi == 800);
  const HandMotion push = Apply(nominal.motion, 800, 0);
  CHECK(push.insertion_mm == Approx(25.4));
  CHECK(push.rotation_rad == 0.0);
  // A turn of the 5 mm cylinder is 31.4 mm of surface.
  const HandMotion turn = Apply(nominal.motion, 0, std::lround(kTurn_rad * 5.0 / 25.4 * 800));
  CHECK(turn.rotation_rad == Approx(kTurn_rad).epsilon(1e-3));
  CHECK(turn.insertion_mm == 0.0);
}

TEST_CASE("A misaligned sensor mixes pushing and turning as drawn, and the model unmixes them") {
  const double angle = 0.1;
  const double gain = 0.02;
  const double radius = 4.0;
  const MotionModel model = ModelOf({.gain_mm_per_count = gain,
                                     .misalignment_rad = angle,
                                     .cylinder_radius_mm = radius,
                                     .skew_rad = 0.0},
                                    1200);
  // Sensor counts, by the figure in the header, for a push of 100 mm and a turn of 3 rad.
  const double s = 100.0;
  const double c = radius * 3.0;
  const auto axial = std::llround((std::cos(angle) * s - std::sin(angle) * c) / gain);
  const auto transverse = std::llround((std::sin(angle) * s + std::cos(angle) * c) / gain);
  const HandMotion motion = Apply(model, axial, transverse);
  CHECK(motion.insertion_mm == Approx(100.0).margin(2 * gain));
  CHECK(motion.rotation_rad == Approx(3.0).margin(2 * gain / radius));
}

TEST_CASE("Parameters and model are inverse to each other") {
  const MotionParameters parameters{.gain_mm_per_count = 0.0212,
                                    .misalignment_rad = -0.04,
                                    .cylinder_radius_mm = 5.2,
                                    .skew_rad = 0.015};
  const MotionParameters back = ParametersOf(ModelOf(parameters, 1200));
  CHECK(back.gain_mm_per_count == Approx(parameters.gain_mm_per_count).epsilon(1e-12));
  CHECK(back.misalignment_rad == Approx(parameters.misalignment_rad).epsilon(1e-12));
  CHECK(back.cylinder_radius_mm == Approx(parameters.cylinder_radius_mm).epsilon(1e-12));
  CHECK(back.skew_rad == Approx(parameters.skew_rad).epsilon(1e-9));
}

TEST_CASE("Huge counts are exact") {
  MotionModel model;
  model.per_count = {{{1.0, 0.0}, {0.0, 1.0}}};
  const std::int64_t huge = (std::int64_t{1} << 53) - 1;
  CHECK(Apply(model, huge, -huge).insertion_mm == 9007199254740991.0);
  CHECK(Apply(model, huge, -huge).rotation_rad == -9007199254740991.0);
}

TEST_CASE("A joystick axis is quiet around its center and full at its ends") {
  const JoystickAxis axis{.center = 500.0,
                          .minimum = 100.0,
                          .maximum = 1000.0,
                          .dead_zone = 50.0,
                          .full_rate_rad_per_s = 2.0};
  CHECK(Rate(axis, 500) == 0.0);
  CHECK(Rate(axis, 550) == 0.0);
  CHECK(Rate(axis, 450) == 0.0);
  CHECK(Rate(axis, 551) == Approx(2.0 / 450.0));
  CHECK(Rate(axis, 775) == Approx(1.0));
  CHECK(Rate(axis, 1000) == Approx(2.0));
  CHECK(Rate(axis, 1023) == Approx(2.0));
  CHECK(Rate(axis, 275) == Approx(-1.0));
  CHECK(Rate(axis, 100) == Approx(-2.0));
  CHECK(Rate(axis, 0) == Approx(-2.0));
}
