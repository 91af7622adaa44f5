#include "host/simulator/core/wire_model.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

#include "tests/support/wires.h"

namespace torquer::test {
namespace {

TEST_CASE("A wire that cannot be simulated is refused with field, value and range") {
  struct Case {
    const char* says;
    std::function<void(double& segment, std::vector<WireSection>& sections, double& tip,
                       double& length, Sheath& sheath)>
        spoil;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  using Sections = std::vector<WireSection>;
  const Case cases[] = {
      {"segment_mm is 0", [](double& s, Sections&, double&, double&, Sheath&) { s = 0; }},
      {"segment_mm is nan", [=](double& s, Sections&, double&, double&, Sheath&) { s = nan; }},
      {"max_length_mm is inf",
       [=](double&, Sections&, double&, double& l, Sheath&) { l = infinity; }},
      {"tip_mm is -1", [](double&, Sections&, double& t, double&, Sheath&) { t = -1; }},
      {"at most 1e6 segments",
       [](double& s, Sections&, double&, double& l, Sheath&) { s = 1e-3, l = 1001; }},
      {"at least one section", [](double&, Sections& w, double&, double&, Sheath&) { w.clear(); }},
      {"section from_tip_mm is -1",
       [](double&, Sections& w, double&, double&, Sheath&) { w[0].from_tip_mm = -1; }},
      {"ascending",
       [](double&, Sections& w, double&, double&, Sheath&) { w.push_back(w.front()); }},
      {"rigidity_N_mm2 is 0",
       [](double&, Sections& w, double&, double&, Sheath&) { w[0].rigidity_N_mm2 = 0; }},
      {"radius_mm is -0.1",
       [](double&, Sections& w, double&, double&, Sheath&) { w[0].radius_mm = -0.1; }},
      {"at most 1.5 rad",
       [](double&, Sections& w, double&, double&, Sheath&) { w[0].curvature_2_per_mm = 1.6; }},
      {"unit direction",
       [](double&, Sections&, double&, double&, Sheath& s) { s.direction *= 1.1; }},
      {"finite point",
       [=](double&, Sections&, double&, double&, Sheath& s) { s.point_mm[1] = nan; }},
  };
  for (const Case& c : cases) {
    double segment = 1;
    Sections sections = {{0, 6.35e-3, 0.178, 0, 0}};
    double tip = 0;
    double length = 100;
    Sheath sheath;
    c.spoil(segment, sections, tip, length, sheath);
    INFO(c.says);
    CHECK_THROWS_AS(WireModel(segment, sections, tip, length, BendingLaw::kExact, sheath),
                    std::invalid_argument);
    CHECK_THROWS_WITH(WireModel(segment, sections, tip, length, BendingLaw::kExact, sheath),
                      Catch::Contains(c.says));
  }
}

TEST_CASE("Sections are linear in between and constant beyond") {
  const std::vector<WireSection> sections = {
      {0, 1, 0.1, 0, 0}, {10, 11, 0.2, 0, 0}, {30, 11, 0.3, 0, 0}};
  const WireModel model(2, sections, 0, 100, BendingLaw::kExact, {});
  CHECK(SectionAt(sections, 4).rigidity_N_mm2 == Approx(5));
  CHECK(SectionAt(sections, 10).rigidity_N_mm2 == Approx(11));
  CHECK(SectionAt(sections, 98).rigidity_N_mm2 == Approx(11));
  // Compliances add up over the hat of a joint: integrals of w / EI in closed form.
  CHECK(model.rigidity_N_mm2(0) == Approx(2 / (1.5 * std::log(3.0))));
  CHECK(model.rigidity_N_mm2(5) == Approx(2 / (1 - 4.5 * std::log(11.0 / 9) + 1.0 / 11)));
  CHECK(model.rigidity_N_mm2(6) == 11);
  CHECK(model.rigidity_N_mm2(49) == Approx(11));
  CHECK(model.radius_mm(10) == Approx(0.25));
  CHECK(model.radius_mm(40) == Approx(0.3));
  CHECK(model.first_straight_joint() == 0);
  CHECK(model.max_segments() == 51);
}

TEST_CASE("A curved tip rests curved to its end, and no farther") {
  const WireModel model = MakeWire({.segment_mm = 2, .tip_mm = 10, .tip_curvature_1_per_mm = 0.1});
  CHECK(model.tip_segments() == 5);
  // Joints at 2, 4 .. 10 mm from the end.
  CHECK(model.first_straight_joint() == 6);
  for (int k = 1; k < 6; ++k) {
    CHECK(model.rest_direction(k).norm() == Approx(1));
    // Half of the last joint's hat is straight.
    CHECK(std::acos(model.rest_direction(k)[2]) == Approx(k < 5 ? 0.2 : 0.1));
    CHECK(model.rest_direction(k)[0] > 0);
  }
  CHECK(model.rest_direction(6) == Vector3d(0, 0, 1));
}

TEST_CASE("The sheath's normal is across its direction, for any direction") {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int k = 0; k < 100; ++k) {
    Vector3d u(normal(random), normal(random), normal(random));
    if (k < 3) u = Vector3d::Unit(k);
    u.normalize();
    const WireModel model = MakeWire({.sheath = {Vector3d::Zero(), u}});
    CHECK(std::abs(model.sheath_normal().dot(u)) < 1e-14);
    CHECK(model.sheath_normal().norm() == Approx(1));
  }
}

}  // namespace
}  // namespace torquer::test
