#include "host/simulator/effects/imaging/fluoroscopy.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/imaging/fluoroscopy_noise.h"
#include "host/simulator/simulation.h"
#include "host/support/angles.h"
#include "tests/effects/vascular_scene.h"

using Catch::Contains;
using Eigen::Vector3d;
using torquer::kRadPerDeg;
using torquer::effects::AddWire;
using torquer::effects::Body;
using torquer::effects::CArm;
using torquer::effects::FillWithBody;
using torquer::effects::FillWithNoise;
using torquer::effects::ImagePoint;
using torquer::effects::ImageSource;
using torquer::effects::LumenPainter;
using torquer::effects::LumenPoint;
using torquer::effects::Plane;
using torquer::effects::Projection;
using torquer::effects::WirePoint;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kFork;
using torquer::test::kStraight;
using torquer::test::Refusal;
using torquer::test::SceneOf;

namespace {

CArm Arm() {
  CArm arm;
  arm.isocenter_mm = {10, 20, 30};
  arm.sid_mm = 1000;
  arm.sod_mm = 800;
  arm.detector_mm = 256;
  arm.width = arm.height = 256;
  return arm;
}

Plane Blank(const CArm& arm) {
  Plane plane;
  plane.Clear(arm.width, arm.height);
  return plane;
}

double Sum(const Plane& plane) {
  double sum = 0;
  for (const float value : plane.value) sum += static_cast<double>(value);
  return sum;
}

// A straight lumen, sampled every millimeter.
std::vector<LumenPoint> Lumen(const Vector3d& from, const Vector3d& to, double r0, double r1,
                              float attenuation_1_mm) {
  std::vector<LumenPoint> points;
  const int steps = static_cast<int>((to - from).norm());
  for (int i = 0; i <= steps; ++i) {
    const double x = static_cast<double>(i) / steps;
    points.push_back(
        {from + x * (to - from), (to - from).normalized(), r0 + x * (r1 - r0), attenuation_1_mm});
  }
  return points;
}

Plane Painted(const CArm& arm, const Projection& projection,
              const std::vector<std::vector<LumenPoint>>& lumens) {
  Plane plane = Blank(arm);
  LumenPainter painter;
  painter.Begin(arm.width, arm.height);
  for (const auto& lumen : lumens) painter.Add(projection, lumen.data(), lumen.size());
  painter.AddTo(projection, plane);
  return plane;
}

const std::string kXray = "[effects.fluoroscopy]\nwidth_px = 64\nheight_px = 64\n";

Command At(double time_s, bool xray) {
  Command command;
  command.target[0].insertion_mm = 60;
  command.time_s = time_s;
  command.controls.xray = xray;
  return command;
}

bool TickDue(Simulation& session, const Command& command) {
  torquer::CountedBudget budget(100);
  session.Tick(command, budget);
  return session.picture_due();
}

}  // namespace

TEST_CASE("Known points are projected by the geometry of the C-arm", "[effects]") {
  const CArm arm = Arm();
  const double middle = 127.5;
  SECTION("from the front: the patient's left is right, cranial is up") {
    const Projection projection(arm, 0, 0);
    const ImagePoint iso = projection.Project(arm.isocenter_mm);
    CHECK(iso.column == Approx(middle).margin(1e-9));
    CHECK(iso.row == Approx(middle).margin(1e-9));
    CHECK(iso.depth_mm == Approx(800).margin(1e-9));
    // LPS: left is +x, posterior +y, superior +z. The source is behind the patient.
    const ImagePoint left = projection.Project(arm.isocenter_mm + Vector3d(8, 0, 0));
    CHECK(left.column == Approx(middle + 10).margin(1e-9));
    const ImagePoint up = projection.Project(arm.isocenter_mm + Vector3d(0, 0, 16));
    CHECK(up.row == Approx(middle - 20).margin(1e-9));
    // Objects nearer to the source, which is behind the patient, appear larger.
    const ImagePoint behind = projection.Project(arm.isocenter_mm + Vector3d(8, 400, 0));
    CHECK(behind.column == Approx(middle + 20).margin(1e-9));
  }
  SECTION("LAO turns the detector to the patient's left, CRA to the head") {
    // In LAO, the patient's left side comes nearer to the detector.
    const Projection lao(arm, 90 * kRadPerDeg, 0);
    CHECK(lao.Project(arm.isocenter_mm + Vector3d(100, 0, 0)).depth_mm == Approx(900).margin(1e-9));
    // The patient's back is then on the right of the picture.
    CHECK(lao.Project(arm.isocenter_mm + Vector3d(0, 8, 0)).column ==
          Approx(middle + 10).margin(1e-9));
    const Projection cra(arm, 0, 90 * kRadPerDeg);
    CHECK(cra.Project(arm.isocenter_mm + Vector3d(0, 0, 100)).depth_mm == Approx(900).margin(1e-9));
  }
  SECTION("any angles: the picture of a point lies on the line from the source") {
    for (const double lao : {-50.0, 20.0, 75.0}) {
      for (const double cra : {-30.0, 10.0, 35.0}) {
        const Projection projection(arm, lao * kRadPerDeg, cra * kRadPerDeg);
        const Vector3d point = arm.isocenter_mm + Vector3d(31, -22, 17);
        const ImagePoint at = projection.Project(point);
        const Vector3d ray = projection.camera().transpose() *
                             Vector3d(projection.RightOf(at.column), projection.UpOf(at.row), 1);
        const Vector3d back = projection.source_mm() + at.depth_mm * ray;
        CHECK((back - point).norm() < 1e-9);
        CHECK((projection.camera() * projection.camera().transpose() - Eigen::Matrix3d::Identity())
                  .norm() < 1e-12);
        CHECK(projection.camera().determinant() == Approx(1));
      }
    }
  }
}

TEST_CASE("A wire absorbs as the chord of its cylinder", "[effects]") {
  CArm arm = Arm();
  arm.width = arm.height = 1024;  // 0.2 mm a pixel at the isocenter
  const Projection projection(arm, 0, 0);
  // 2 mm thick, so that the middle pixels lie well inside.
  for (const Vector3d& along : {Vector3d(1, 0, 0), Vector3d(1, 0, 0.7), Vector3d(1, 0.8, 0.2)}) {
    const Vector3d axis = along.normalized();
    std::vector<WirePoint> wire;
    for (int i = -20; i <= 20; ++i) wire.push_back({arm.isocenter_mm + i * axis, 1, 0.5});
    Plane plane = Blank(arm);
    AddWire(projection, wire, plane);
    // Around the central ray, which runs along -y.
    const double slanted = std::sqrt(1 - axis[1] * axis[1]);
    CHECK(plane.At(511, 511) == Approx(0.5 * 2 / slanted).epsilon(0.015));
    // Sum over all pixels: attenuation times volume over the pixel's area, here magnified.
    const double pixel_mm = arm.pixel_mm() * arm.sod_mm / arm.sid_mm;
    CHECK(Sum(plane) * pixel_mm * pixel_mm == Approx(0.5 * std::numbers::pi * 40).epsilon(0.01));
  }
}

TEST_CASE("A wire thinner than a pixel keeps its mass wherever it lies", "[effects]") {
  const CArm arm = Arm();
  const Projection projection(arm, 0.3, 0.2);
  const double pixel_mm = arm.pixel_mm() * arm.sod_mm / arm.sid_mm;
  for (double shift = 0; shift < 1; shift += 0.23) {
    const Vector3d start = arm.isocenter_mm + pixel_mm * shift * Vector3d(0.3, 0.1, 0.9);
    std::vector<WirePoint> wire;
    for (int i = -20; i <= 20; ++i) {
      wire.push_back({start + i * projection.camera().row(0).transpose() +
                          0.2 * i * projection.camera().row(1).transpose(),
                      0.15, 3});
    }
    Plane plane = Blank(arm);
    AddWire(projection, wire, plane);
    const double length_mm = 40 * std::hypot(1, 0.2);
    CHECK(Sum(plane) * pixel_mm * pixel_mm ==
          Approx(3 * std::numbers::pi * 0.15 * 0.15 * length_mm).epsilon(0.005));
  }
}

TEST_CASE("A lumen absorbs as its chord, at any angle, without seams", "[effects]") {
  const CArm arm = Arm();
  const Projection projection(arm, 0.4, -0.2);
  const Vector3d right = projection.camera().row(0);
  const Vector3d up = projection.camera().row(1);
  const Vector3d deep = projection.camera().row(2);
  for (const double slant : {0.0, 0.6, 1.2}) {
    const Vector3d axis = std::cos(slant) * right + std::sin(slant) * deep;
    const Plane plane =
        Painted(arm, projection,
                {Lumen(arm.isocenter_mm - 50 * axis, arm.isocenter_mm + 50 * axis, 5, 5, 0.1F)});
    double worst = 0;
    for (int column = 120; column <= 135; ++column) {
      for (int row = 123; row <= 132; ++row) {
        // Closed form: exit point of the ray from the cylinder minus its entry point.
        const Vector3d ray =
            (projection.RightOf(column) * right + projection.UpOf(row) * up + deep).normalized();
        const Vector3d from = projection.source_mm() - arm.isocenter_mm;
        const Vector3d d = ray - ray.dot(axis) * axis;
        const Vector3d w = from - from.dot(axis) * axis;
        const double root = std::sqrt(d.dot(w) * d.dot(w) - d.squaredNorm() * (w.dot(w) - 25));
        const double expected = 0.1 * 2 * root / d.squaredNorm();
        const auto pixel = static_cast<std::size_t>(row * 256 + column);
        worst = std::max(worst, std::abs(static_cast<double>(plane.value[pixel]) - expected));
      }
    }
    CHECK(worst < 2e-4);
  }
}

TEST_CASE("A lumen seen along its axis absorbs in proportion to its length", "[effects]") {
  const CArm arm = Arm();
  const Projection projection(arm, 0, 0);
  const Vector3d deep = projection.camera().row(2);
  Plane plane =
      Painted(arm, projection,
              {Lumen(arm.isocenter_mm - 20 * deep, arm.isocenter_mm + 20 * deep, 6, 6, 0.1F)});
  CHECK(plane.At(127, 127) == Approx(4).epsilon(1e-3));
  // Narrowing along the ray: a ray half a pixel off in both directions leaves the cone.
  plane =
      Painted(arm, projection,
              {Lumen(arm.isocenter_mm - 20 * deep, arm.isocenter_mm + 20 * deep, 4, 0.1, 0.1F)});
  CHECK(plane.At(127, 127) == Approx(0.1 * 40 * (4 - 0.566) / 3.9).epsilon(0.02));
}

TEST_CASE("Overlapping lumens absorb once, as their union", "[effects]") {
  const CArm arm = Arm();
  const Projection projection(arm, 0, 0);
  const Vector3d at = arm.isocenter_mm;
  const auto trunk = Lumen(at - Vector3d(40, 0, 0), at + Vector3d(40, 0, 0), 5, 5, 0.1F);
  const auto branch = Lumen(at, at + Vector3d(0, 0, 40), 3, 3, 0.1F);
  Plane alone = Painted(arm, projection, {trunk});
  Plane both = Painted(arm, projection, {trunk, branch});
  CHECK(both.At(127, 127) == Approx(alone.At(127, 127)).epsilon(1e-4));
  // Beyond the trunk the branch is alone. Its value is the mean of 0.2 sqrt(9 - x^2) over a pixel
  // from its axis, x = 0 to 0.8. Overlapping vessels add up.
  CHECK(both.At(127, 127 - 25) == Approx(0.5928).epsilon(0.003));
  const auto behind = Lumen(at + Vector3d(-40, 30, 0), at + Vector3d(40, 30, 0), 5, 5, 0.1F);
  Plane two = Painted(arm, projection, {trunk, behind});
  CHECK(two.At(127, 127) == Approx(2 * alone.At(127, 127)).epsilon(0.01));
}

TEST_CASE("The body absorbs as its ellipse is thick", "[effects]") {
  CArm arm = Arm();
  Body body;
  body.center_mm = arm.isocenter_mm;
  body.spine_1_mm = 0;
  Plane front = Blank(arm);
  const float mean = FillWithBody(Projection(arm, 0, 0), body, front);
  Plane side = Blank(arm);
  FillWithBody(Projection(arm, 90 * kRadPerDeg, 0), body, side);
  // Equal up to the slow waves of the organs.
  CHECK(front.At(127, 127) == Approx(body.tissue_1_mm * body.depth_mm).epsilon(0.15));
  CHECK(side.At(127, 127) == Approx(body.tissue_1_mm * body.width_mm).epsilon(0.15));
  CHECK(mean > 2);
  body.spine_1_mm = 0.01;
  Plane with_spine = Blank(arm);
  FillWithBody(Projection(arm, 0, 0), body, with_spine);
  CHECK(with_spine.At(127, 127) > front.At(127, 127) + 0.1F);
  CHECK(with_spine.At(60, 127) == front.At(60, 127));
}

TEST_CASE("Noise is Gaussian, of variance 1, and repeatable by its seed", "[effects]") {
  constexpr std::size_t kCount = 200000;
  std::vector<float> noise(kCount);
  FillWithNoise(7, 3, noise.data(), kCount);
  double mean = 0;
  double square = 0;
  double fourth = 0;
  double neighbors = 0;
  for (std::size_t i = 0; i < kCount; ++i) {
    const double x = static_cast<double>(noise[i]);
    mean += x / kCount;
    square += x * x / kCount;
    fourth += x * x * x * x / kCount;
    if (i > 0) neighbors += x * static_cast<double>(noise[i - 1]) / kCount;
  }
  CHECK(mean == Approx(0).margin(0.01));
  CHECK(square == Approx(1).epsilon(0.01));
  CHECK(fourth == Approx(3).epsilon(0.03));
  CHECK(neighbors == Approx(0).margin(0.01));
  std::vector<float> again(kCount);
  FillWithNoise(7, 3, again.data(), kCount);
  CHECK(again == noise);
  FillWithNoise(7, 4, again.data(), kCount);
  CHECK(again != noise);
  FillWithNoise(8, 3, again.data(), kCount);
  CHECK(again != noise);
}

TEST_CASE("The noise of a picture is that of its photons", "[effects]") {
  for (const double photons : {200.0, 5000.0}) {
    SceneOf scene(kStraight +
                  "attenuation_1_mm = 0\n[effects.fluoroscopy]\nbody_width_mm = 0\ngain = "
                  "2\nwidth_px = 256\nheight_px = 256\n"
                  "photons = " +
                  std::to_string(photons) + "\n");
    Simulation session(*scene);
    REQUIRE(TickDue(session, At(0.001, true)));
    ImageSource::Picture picture;
    session.image()->Render(picture);
    double mean = 0;
    double square = 0;
    for (const std::uint8_t gray : picture.gray) {
      mean += static_cast<double>(gray) / 65536;
      square += static_cast<double>(gray) * gray / 65536;
    }
    // Quantization of the gray values adds a variance of 1/12.
    const double variance = square - mean * mean - 1.0 / 12;
    CHECK(std::sqrt(variance) / (255 * 2) == Approx(1 / std::sqrt(photons)).epsilon(0.02));
  }
}

TEST_CASE("Pictures are taken while the pedal is down, at their rate", "[effects]") {
  SceneOf scene(kFork + kXray + "pictures_per_s = 10\n");
  Simulation session(*scene);
  int taken = 0;
  double time_s = 0;
  const auto run = [&](int ticks, bool xray) {
    const int before = taken;
    for (int k = 0; k < ticks; ++k) taken += TickDue(session, At(time_s += 1e-3, xray));
    return taken - before;
  };
  CHECK(run(500, false) == 0);
  CHECK(run(1, true) == 1);  // at once
  CHECK(run(999, true) == 9);
  CHECK(run(300, false) == 0);
  CHECK(run(1, true) == 1);
  // A restart repeats the same pictures.
  session.Restart();
  time_s = 0;
  CHECK(run(500, false) == 0);
  CHECK(run(1000, true) == 10);
}

TEST_CASE("The same session gives the same pictures", "[effects]") {
  std::vector<std::uint8_t> first;
  for (int round = 0; round < 2; ++round) {
    SceneOf scene(kFork + kXray);
    Simulation session(*scene);
    ImageSource::Picture picture;
    for (int k = 1; k <= 3; ++k) {
      REQUIRE(TickDue(session, At(0.1 * k, true)));
      session.image()->Render(picture);
    }
    if (round == 0) first = picture.gray;
    CHECK(picture.gray == first);
    CHECK(picture.time_s == Approx(0.3));
  }
}

TEST_CASE("Subtraction shows dye alone, a roadmap keeps it", "[effects]") {
  const std::string flow =
      "[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\n"
      "[effects.contrast]\nrate_mL_s = 5\n"
      "[effects.fluoroscopy]\nwidth_px = 64\nheight_px = 64\nphotons = 1e6\n"
      "isocenter_mm = [100, 0, 0]\n";
  for (const bool roadmap : {false, true}) {
    SceneOf scene(kStraight + flow +
                  (roadmap ? "mode = \"roadmap\"\n" : "mode = \"subtraction\"\n"));
    Simulation session(*scene);
    ImageSource::Picture picture;
    // Beyond the wire's tip at 41 mm; the vessel runs along the patient's left (x) and along y.
    const auto gray = [&picture](int row) {
      return static_cast<int>(picture.gray[static_cast<std::size_t>(row * 64 + 32)]);
    };
    const auto take = [&](double time_s, bool contrast) {
      Command command = At(time_s, true);
      command.target[0].insertion_mm = 40;
      command.controls.contrast = contrast;
      REQUIRE(TickDue(session, command));
      session.image()->Render(picture);
    };
    take(0.1, false);
    const int blank = gray(32);
    CHECK(std::abs(gray(10) - blank) <= 2);
    take(2, true);
    CHECK(std::abs(gray(10) - blank) <= 2);
    CHECK((roadmap ? gray(32) > blank + 15 : gray(32) < blank - 25));
    // The dye has washed out of the picture, but it stays in the road map.
    take(60, false);
    CHECK((roadmap ? gray(32) > blank + 15 : std::abs(gray(32) - blank) <= 2));
  }
}

TEST_CASE("Fluoroscopy that cannot be is refused with key, value and remedy", "[effects]") {
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nwidth_px = 5000\n"),
             Contains("test.toml:") && Contains("width_px = 5000") && Contains("1024"));
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nheight_px = 10\n"),
             Contains("height_px = 10") && Contains("64"));
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nsod_mm = 1200\n"),
             Contains("sod_mm = 1200") && Contains("sid_mm"));
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nphotons = nan\n"), Contains("photons"));
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nmode = \"dsa\"\n"), Contains("subtraction"));
  CHECK_THAT(Refusal(kFork + "[effects.fluoroscopy]\nisocenter_mm = [0, 0]\n"),
             Contains("isocenter_mm"));
}
