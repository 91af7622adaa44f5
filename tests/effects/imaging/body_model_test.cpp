// Body model: its shapes against closed forms, and against itself in other frames.
#include "host/simulator/effects/imaging/body_model.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "host/support/angles.h"

namespace torquer::effects {
namespace {

using Eigen::Vector3d;

CArm Arm() {
  CArm arm;
  arm.isocenter_mm = Vector3d(12, -7, 30);
  arm.width = arm.height = 257;
  return arm;
}

// A body whose place `there` (left, posterior, superior of its center) is at the isocenter.
Body At(const CArm& arm, BodyRegion region, const Vector3d& there) {
  Body body;
  body.region = region;
  body.center_mm = arm.isocenter_mm - there;
  return body;
}

// Line integral along the middle ray, without tubes.
double Middle(const CArm& arm, const Body& body, double lao_deg = 0, double cra_deg = 0) {
  return MiddleIntegral(Projection(arm, lao_deg * kRadPerDeg, cra_deg * kRadPerDeg), body);
}

Plane Tubes(const CArm& arm, const Body& body, double lao_deg = 0) {
  Plane plane;
  plane.Clear(arm.width, arm.height);
  AddTubes(Projection(arm, lao_deg * kRadPerDeg, 0), body, plane);
  return plane;
}

double Sum(const Plane& plane) {
  double sum = 0;
  for (const float value : plane.value) sum += static_cast<double>(value);
  return sum;
}

TEST_CASE("A lung lacks three quarters of the tissue along its length on a ray", "[effects]") {
  const CArm arm = Arm();
  // 85 mm above the diaphragm, a quarter of the width beside the middle; the arch is at 130 mm.
  const Body body = At(arm, BodyRegion::kArch, {-0.25 * 320, 0.02 * 220, 85 - 130});
  // A lung is 0.68 of the depth thick. Tissue varies by 12.6 % with the organs.
  const double trunk_mm = 220 * std::sqrt(1 - 0.25);
  CHECK(Middle(arm, body) / 0.018 == Approx(trunk_mm - 0.74 * 0.68 * 220).margin(0.126 * trunk_mm));
}

TEST_CASE("A skull is a shell of bone around the brain", "[effects]") {
  const CArm arm = Arm();
  Body body = At(arm, BodyRegion::kHead, {0, 0, 30});
  const double with_bone = Middle(arm, body, 90);
  body.spine_1_mm = 0;
  // From the side: half axis of 76 mm, at 30 mm of 108 mm above the middle.
  const double half_mm = 76 * std::sqrt(1 - 30.0 * 30 / (108 * 108));
  CHECK(Middle(arm, body, 90) == Approx(0.018 * 2 * half_mm).epsilon(0.13));
  // Two tables of 6 mm, in which bone counts twice.
  CHECK(with_bone - Middle(arm, body, 90) == Approx(0.01 * 2 * 2 * 6).epsilon(0.1));
}

TEST_CASE("The region is a height in one patient", "[effects]") {
  const CArm arm = Arm();
  const Body heart = At(arm, BodyRegion::kHeart, {20, 10, 30});
  // The arch is 90 mm above the heart, the head 275 mm above the arch.
  const Body arch = At(arm, BodyRegion::kArch, {20, 10, 30 - 90});
  const Body head = At(arm, BodyRegion::kHead, {20, 10, 30 - 365});
  for (const double lao_deg : {0.0, 40.0, 90.0}) {
    for (const double cra_deg : {-25.0, 0.0}) {
      const double expected = Middle(arm, heart, lao_deg, cra_deg);
      CHECK(Middle(arm, arch, lao_deg, cra_deg) == Approx(expected).epsilon(1e-12));
      CHECK(Middle(arm, head, lao_deg, cra_deg) == Approx(expected).epsilon(1e-12));
    }
  }
  Body with_tubes = heart;
  with_tubes.tubes = TubesOf(heart);
  Body of_arch = arch;
  of_arch.tubes = TubesOf(arch);
  const Plane a = Tubes(arm, with_tubes, 20), b = Tubes(arm, of_arch, 20);
  CHECK(Sum(a) > 100);
  for (std::size_t i = 0; i < a.value.size(); ++i) {
    REQUIRE(a.value[i] == Approx(b.value[i]).margin(1e-4));
  }
}

TEST_CASE("A tube has its volume from the side and from its end", "[effects]") {
  const CArm arm = Arm();
  Body body = At(arm, BodyRegion::kHeart, Vector3d::Zero());
  const Vector3d half(0, 15, 0);
  body.tubes = std::make_shared<const BodyTubes>(
      BodyTubes{{{{arm.isocenter_mm - half, 4, 0.02}, {arm.isocenter_mm + half, 4, 0.02}}}, {}});
  const double expected = 0.02 * std::numbers::pi * 4 * 4 * 30;
  // A pixel at the isocenter is 0.834 mm wide.
  const double pixel_mm = 300.0 / 257 * 750 / 1050;
  for (const double lao_deg : {0.0, 30.0, 90.0}) {
    const double mass = Sum(Tubes(arm, body, lao_deg)) * pixel_mm * pixel_mm;
    CHECK(mass == Approx(expected).epsilon(0.02));
  }
  // From its end, a disk as thick as the tube is long.
  const Plane from_end = Tubes(arm, body);
  CHECK(from_end.value[128 * 257 + 128] > 0.02F * 30);
  CHECK(from_end.value[128 * 257 + 128 + 7] == 0);
}

TEST_CASE("Breath moves diaphragm, heart and vessels of the lungs, and no bone", "[effects]") {
  const CArm arm = Arm();
  // Just above the right dome, 10 mm above the diaphragm's height.
  Body body = At(arm, BodyRegion::kHeart, {-0.22 * 320, 0, 10 - 40 + 3});
  body.tubes = TubesOf(body);
  const double before = Middle(arm, body);
  const Plane still = Tubes(arm, body);
  body.organs_mm = Vector3d(0, 0, 15);
  CHECK(Middle(arm, body) > before + 0.018 * 0.74 * 20);
  Body bones = body;
  bones.tubes = std::make_shared<const BodyTubes>(BodyTubes{body.tubes->bones, {}});
  const Plane of_bones = Tubes(arm, bones);
  bones.organs_mm.setZero();
  CHECK(Tubes(arm, bones).value == of_bones.value);
  CHECK(Tubes(arm, body).value != still.value);
}

TEST_CASE("A trunk has neither ends nor tubes", "[effects]") {
  const CArm arm = Arm();
  Body body = At(arm, BodyRegion::kTrunk, Vector3d::Zero());
  CHECK(TubesOf(body) == nullptr);
  body.spine_1_mm = 0;
  for (const double height_mm : {-500.0, 500.0}) {
    body.center_mm = arm.isocenter_mm - Vector3d(0, 0, height_mm);
    CHECK(Middle(arm, body) == Approx(0.018 * 220).epsilon(0.13));
  }
  body.width_mm = 0;
  body.region = BodyRegion::kHeart;
  CHECK(TubesOf(body) == nullptr);
  CHECK(Middle(arm, body) == 0);
}

}  // namespace
}  // namespace torquer::effects
