// Physics of gray values: dye thinner than a pixel, scatter, motion since the mask, and dose.
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"

using Eigen::Vector3d;
using torquer::effects::CArm;
using torquer::effects::ImageSource;
using torquer::effects::LumenPainter;
using torquer::effects::LumenPoint;
using torquer::effects::Plane;
using torquer::effects::Projection;
using torquer::effects::WithScatter;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

constexpr double kPi = std::numbers::pi;

// Painted vessel of 60 mm length through `middle`.
Plane Painted(const CArm& arm, const Vector3d& middle, const Vector3d& axis, double radius_mm) {
  const Projection projection(arm, 0, 0);
  Plane plane;
  plane.Clear(arm.width, arm.height);
  std::vector<LumenPoint> points;
  for (double s = -30; s <= 30; s += 0.75) {
    points.push_back({middle + s * axis, axis, radius_mm, 0.1F});
  }
  LumenPainter painter;
  painter.Begin(arm.width, arm.height);
  painter.Add(projection, points.data(), points.size());
  painter.AddTo(projection, plane);
  return plane;
}

Command WithXray(double time_s, bool xray) {
  Command command;
  command.target[0].insertion_mm = 40;
  command.time_s = time_s;
  command.controls.xray = xray;
  return command;
}

}  // namespace

TEST_CASE("Dye in a thin vessel keeps its iodine wherever it lies", "[effects]") {
  CArm arm;
  arm.sid_mm = 1000;
  arm.sod_mm = 800;
  arm.detector_mm = arm.width = arm.height = 160;
  const double pixel_mm = arm.pixel_mm() * arm.sod_mm / arm.sid_mm;
  double worst = 0;
  double worst_section = 0;
  for (const double radius_mm : {0.2, 0.35, 0.5, 0.75, 1.2, 2.0}) {
    for (const double angle : {0.0, 0.2, kPi / 4, 1.3, kPi / 2}) {
      for (double shift = 0; shift < 1; shift += 0.13) {
        const Vector3d axis(std::cos(angle), 0, std::sin(angle));
        const Vector3d middle = pixel_mm * shift * Vector3d(0.35, 0, 0.93);
        Plane plane = Painted(arm, middle, axis, radius_mm);
        double all = 0;
        for (const float value : plane.value) all += static_cast<double>(value);
        const double section = 0.1 * kPi * radius_mm * radius_mm;
        worst = std::max(worst, std::abs(all * pixel_mm * pixel_mm / (section * 60) - 1));
        if (angle != 0) continue;
        // The same holds for each column across the vessel.
        for (int column = 60; column < 100; ++column) {
          double sum = 0;
          for (int row = 0; row < arm.height; ++row) {
            sum += static_cast<double>(plane.At(column, row));
          }
          worst_section = std::max(worst_section, std::abs(sum * pixel_mm / section - 1));
        }
      }
    }
  }
  INFO(worst << " of all, " << worst_section << " of a section");
  CHECK(worst < 0.02);
  CHECK(worst_section < 0.02);
}

TEST_CASE("A marker is painted with its length, for any ends of segments", "[effects]") {
  // Darkness of a picture in which only the marker attenuates. It grows with the marker's volume.
  const auto darkness = [](double marker_mm, double segment_mm, double insertion_mm) {
    SceneOf scene(kStraight + "attenuation_1_mm = 0\nmarker_1_mm = 1\nmarker_mm = " +
                  std::to_string(marker_mm) +
                  "\n[relaxation]\nsegment_mm = " + std::to_string(segment_mm) +
                  "\n[effects.fluoroscopy]\nwidth_px = 256\nheight_px = 65\nphotons = 1e7\n"
                  "detector_mm = 60\nbody_width_mm = 0\nisocenter_mm = [35, 0, 0]\ngain = 0.5\n");
    Simulation session(*scene);
    Command command = WithXray(0.1, true);
    command.target[0].insertion_mm = insertion_mm;
    torquer::CountedBudget budget(1000);
    session.Tick(command, budget);
    ImageSource::Picture picture;
    session.image()->Render(picture);
    double sum = 0;
    for (const std::uint8_t gray : picture.gray) sum += picture.gray.front() - gray;
    return sum;
  };
  // A longer marker adds wire of the same darkness per length.
  const double per_mm = (darkness(16, 0.5, 40) - darkness(8, 0.5, 40)) / 8;
  REQUIRE(per_mm > 0);
  for (const double segment_mm : {0.5, 1.0, 1.7, 3.0, 5.0}) {
    for (const double insertion_mm : {40.0, 40.3, 41.21, 42.9}) {
      INFO("segments of " << segment_mm << " mm, inserted " << insertion_mm << " mm");
      CHECK(darkness(2, segment_mm, insertion_mm) / per_mm == Approx(2).epsilon(0.03));
    }
  }
}

TEST_CASE("Scatter weakens shadows by Beer and Lambert's law with a background", "[effects]") {
  // Gray value behind dye in a wide tube, in a picture nearly without noise.
  const auto gray = [](const std::string& more, bool contrast) {
    SceneOf scene(kStraight +
                  "attenuation_1_mm = 0\n[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = 5\n"
                  "[effects.contrast]\nrate_mL_s = 20\n"
                  "[effects.fluoroscopy]\nwidth_px = 64\nheight_px = 65\nphotons = 1e7\n"
                  "detector_mm = 50\nbody_width_mm = 0\nisocenter_mm = [100, 0, 0]\ngain = 0.5\n"
                  "iodine_1_mm_mg_mL = 1e-3\n" +
                  more);
    Simulation session(*scene);
    ImageSource::Picture picture;
    for (const double time_s : {0.1, 4.0}) {
      Command command = WithXray(time_s, true);
      command.controls.contrast = contrast;
      torquer::CountedBudget budget(1000);
      session.Tick(command, budget);
      session.image()->Render(picture);
    }
    return static_cast<double>(picture.gray[32 * 64 + 32]);
  };
  const double background = gray("", false);
  // 4 mm of 256 mg/mL, reduced by dilution in the blood and by the picture's blur.
  const double attenuation = (background - gray("", true)) / (255 * 0.5);
  REQUIRE(attenuation > 0.8);
  for (const double ratio : {0.5, 1.0, 4.0}) {
    INFO(ratio);
    const std::string scatter = "scatter_to_primary = " + std::to_string(ratio) + "\n";
    CHECK(gray(scatter, false) == Approx(background).margin(1.1));
    const double expected = -std::log((std::exp(-attenuation) + ratio) / (1 + ratio));
    CHECK(background - gray(scatter, true) == Approx(255 * 0.5 * expected).margin(1.6));
  }
  CHECK(WithScatter(1, 0) == 1);
  // Weak shadows lose contrast by the factor 1 + S/P.
  CHECK(static_cast<double>(WithScatter(1e-3F, 3)) == Approx(1e-3 / 4).epsilon(0.01));
}

TEST_CASE("Structures that moved since the mask do not cancel until they are back", "[effects]") {
  // 15 breaths per minute: back after 4 s, farthest after about 1.5 s.
  const auto spread = [](double second_s, bool breathes) {
    SceneOf scene(kStraight +
                  "attenuation_1_mm = 0\n[effects.fluoroscopy]\nmode = \"subtraction\"\n"
                  "width_px = 64\nheight_px = 64\nphotons = 1e7\n" +
                  (breathes ? "[effects.breathing]\nrate_per_min = 15\namplitude_mm = 12\n"
                              "direction = \"inferior\"\n[[effects.breathing.region]]\n"
                              "center_mm = [100, 0, 0]\nradius_mm = 400\nedge_mm = 40\n"
                            : ""));
    Simulation session(*scene);
    ImageSource::Picture picture;
    for (const double time_s : {0.001, second_s}) {
      torquer::CountedBudget budget(5000);
      session.Tick(WithXray(time_s, true), budget);
      session.image()->Render(picture);
    }
    const auto [low, high] = std::minmax_element(picture.gray.begin(), picture.gray.end());
    return *high - *low;
  };
  CHECK(spread(1.6, false) <= 2);
  CHECK(spread(1.6, true) > 8);
  CHECK(spread(4.001, true) <= 2);
}

TEST_CASE("The dose depends on pulses, current and the body's thickness", "[effects]") {
  const auto kerma = [](const std::string& more, double lao_rad, double seconds) {
    SceneOf scene(kStraight + "[effects.fluoroscopy]\nwidth_px = 64\nheight_px = 64\n" + more);
    Simulation session(*scene);
    for (int k = 1; k <= static_cast<int>(100 * seconds); ++k) {
      Command command = WithXray(0.01 * k, true);
      command.controls.lao_rad = lao_rad;
      torquer::CountedBudget budget(1000);
      session.Tick(command, budget);
    }
    return std::pair(Reading(session, "air_kerma_mGy"), Reading(session, "xray_pulses"));
  };
  const std::string plain = "body_width_mm = 0\n";
  const auto [one, pulses] = kerma(plain, 0, 2);
  // 0.06 mGy/(mA s) at 1 m, 10 mA, 8 ms, at 750 - 150 mm.
  CHECK(pulses == 30);
  CHECK(one == Approx(30 * 0.06 * 10 * 8e-3 / (0.6 * 0.6)));
  CHECK(kerma(plain + "pictures_per_s = 7.5\n", 0, 2).first == Approx(one / 2));
  CHECK(kerma(plain + "tube_mA = 20\npulse_ms = 4\n", 0, 2).first == Approx(one));
  // An ellipse of 320 by 220 mm without spine, from the side: 100 mm more of tissue. The organs'
  // waves are a few percent of the body's integral.
  const std::string body = "spine_1_mm = 0\n";
  const double front = kerma(body, 0, 2).first;
  const double side = kerma(body, kPi / 2, 2).first;
  CHECK(std::log(front / one) == Approx(0.018 * 20).margin(0.5));
  CHECK(std::log(side / front) == Approx(0.018 * 100).margin(0.6));
}
