// Operator settings of the X-ray system: their effect on pictures and dose.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/command_limits.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"

using torquer::effects::ImageSource;
using torquer::effects::Imaging;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

Command Chosen(double time_s, const Imaging& imaging) {
  Command command;
  command.target[0].insertion_mm = 40;
  command.time_s = time_s;
  command.controls.xray = true;
  command.controls.imaging = imaging;
  return command;
}

void Tick(Simulation& session, const Command& command) {
  torquer::CountedBudget budget(3000);
  session.Tick(command, budget);
}

struct Dose {
  double pulses, kerma_mGy, area_Gy_cm2, field_mm;
  int pictures;
};

// Dose after 2 s of X-ray at 15 pulses per second in the scene. The settings `imaging` apply first,
// and `later` in the second second.
Dose DoseOf(const Imaging& imaging, const Imaging& later) {
  SceneOf scene(kStraight +
                "[effects.fluoroscopy]\nwidth_px = 128\nheight_px = 64\nbody_width_mm = 0\n");
  Simulation session(*scene);
  int pictures = 0;
  for (int k = 1; k <= 200; ++k) {
    Tick(session, Chosen(0.01 * k, k > 100 ? later : imaging));
    pictures += session.picture_due() ? 1 : 0;
  }
  return {Reading(session, "xray_pulses"), Reading(session, "air_kerma_mGy"),
          Reading(session, "kerma_area_Gy_cm2"), Reading(session, "xray_field_mm"), pictures};
}

Dose DoseOf(const Imaging& imaging) { return DoseOf(imaging, imaging); }

const std::string kVessel =
    "attenuation_1_mm = 3\n[effects.flow]\ninlet = \"tube\"\ninlet_mL_s = "
    "5\n[effects.contrast]\nrate_mL_s = 5\n"
    "[effects.fluoroscopy]\nwidth_px = 128\nheight_px = 128\nphotons = 1e6\nbody_width_mm = 0\n"
    "isocenter_mm = [41, 0, 0]\n";

int Gray(const ImageSource::Picture& picture, int column, int row) {
  return picture.gray[static_cast<std::size_t>(row * picture.width + column)];
}

}  // namespace

TEST_CASE("The pulse rate is the chosen one, otherwise the scene's", "[effects]") {
  Imaging imaging;
  CHECK(DoseOf(imaging).pulses == 30);
  imaging.pulses_per_s = 7.5;
  CHECK(DoseOf(imaging).pulses == 15);
  CHECK(DoseOf(imaging).pictures == 15);
  imaging.pulses_per_s = 30;
  CHECK(DoseOf(imaging).pulses == 60);
  CHECK(DoseOf(imaging).pictures == Approx(60).margin(1));
}

TEST_CASE("A smaller field takes more dose, and shutters take it from the area alone",
          "[effects]") {
  const Dose open = DoseOf({});
  // 0.06 mGy/(mA s), 10 mA, 8 ms at 0.6 m. The beam is 300 mm wide at 1050 mm, so 600/1050 of that
  // there.
  CHECK(open.kerma_mGy == Approx(30 * 0.06 * 10 * 8e-3 / 0.36));
  const double width_cm = 30 * 600.0 / 1050;
  CHECK(open.area_Gy_cm2 == Approx(1e-3 * open.kerma_mGy * width_cm * width_cm / 2));
  CHECK(open.field_mm == Approx(300 * 750.0 / 1050));

  Imaging narrow;
  narrow.magnification = 2;
  CHECK(DoseOf(narrow).kerma_mGy == Approx(4 * open.kerma_mGy));
  CHECK(DoseOf(narrow).area_Gy_cm2 == Approx(open.area_Gy_cm2));
  CHECK(DoseOf(narrow).field_mm == Approx(open.field_mm / 2));
  CHECK(DoseOf({}, narrow).kerma_mGy == Approx(2.5 * open.kerma_mGy));

  Imaging covered;
  covered.left = 0.1;
  covered.right = 0.3;
  covered.top = 0.25;
  CHECK(DoseOf(covered).kerma_mGy == Approx(open.kerma_mGy));
  CHECK(DoseOf(covered).area_Gy_cm2 == Approx(open.area_Gy_cm2 * 0.6 * 0.75));
  CHECK(DoseOf(covered).field_mm == Approx(open.field_mm));
}

TEST_CASE("A smaller field shows the same point so many times farther from the middle",
          "[effects]") {
  // Width of the wire in the picture. It comes from the patient's right and ends at the isocenter.
  const auto thickness = [](double magnification) {
    SceneOf scene(kStraight + kVessel);
    Simulation session(*scene);
    Imaging imaging;
    imaging.magnification = magnification;
    ImageSource::Picture picture;
    Tick(session, Chosen(0.001, imaging));
    session.image()->Render(picture);
    double darkness = 0;
    const int background = Gray(picture, 54, 10);
    for (int row = 40; row < 88; ++row) darkness += background - Gray(picture, 54, row);
    return darkness;
  };
  const double once = thickness(1);
  CHECK(once > 0);
  CHECK(thickness(2) == Approx(2 * once).epsilon(0.1));
  CHECK(thickness(3) == Approx(3 * once).epsilon(0.1));
}

TEST_CASE("Shutters are black, and cover their set fraction", "[effects]") {
  SceneOf scene(kStraight + kVessel);
  Simulation session(*scene);
  Imaging imaging;
  imaging.left = 0.125;
  imaging.right = 0.25;
  imaging.top = 0.375;
  imaging.bottom = 0.0625;
  ImageSource::Picture picture;
  Tick(session, Chosen(0.001, imaging));
  session.image()->Render(picture);
  int wrong = 0;
  for (int row = 0; row < 128; ++row) {
    for (int column = 0; column < 128; ++column) {
      const bool open = column >= 16 && column < 96 && row >= 48 && row < 120;
      wrong += open != (Gray(picture, column, row) > 0) ? 1 : 0;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("The mode can be changed while the pedal is down, and back to the scene's", "[effects]") {
  SceneOf scene(kStraight + kVessel);
  Simulation session(*scene);
  ImageSource::Picture picture;
  const auto take = [&](double time_s, Imaging::Mode mode, bool contrast) {
    Imaging imaging;
    imaging.mode = mode;
    Command command = Chosen(time_s, imaging);
    command.controls.contrast = contrast;
    Tick(session, command);
    session.image()->Render(picture);
  };
  // The wire lies left of the middle; dye flows there and beyond.
  const auto wire = [&] { return Gray(picture, 4, 4) - Gray(picture, 54, 64); };
  const auto dye = [&] { return Gray(picture, 4, 4) - Gray(picture, 90, 64); };
  take(0.1, Imaging::Mode::kAsScene, false);
  CHECK(wire() > 10);
  take(0.3, Imaging::Mode::kSubtraction, false);  // becomes the mask
  CHECK(std::abs(wire()) <= 2);
  take(4, Imaging::Mode::kSubtraction, true);
  CHECK(dye() > 20);
  take(4.2, Imaging::Mode::kPlain, true);
  CHECK(wire() > 10);
  CHECK(dye() > 10);
  take(4.4, Imaging::Mode::kRoadmap, true);
  CHECK(dye() < -10);
  take(60, Imaging::Mode::kRoadmap, false);
  CHECK(dye() < -10);
  take(60.2, Imaging::Mode::kAsScene, false);
  CHECK(std::abs(dye()) <= 2);
  CHECK(wire() > 10);
}

TEST_CASE("Each field has another mask", "[effects]") {
  SceneOf scene(kStraight + kVessel + "mode = \"subtraction\"\n");
  Simulation session(*scene);
  ImageSource::Picture picture;
  for (const double magnification : {1.0, 2.0, 1.5}) {
    Imaging imaging;
    imaging.magnification = magnification;
    Tick(session, Chosen(0.1 + magnification, imaging));
    Tick(session, Chosen(3.1 + magnification, imaging));
    session.image()->Render(picture);
    const auto [low, high] = std::minmax_element(picture.gray.begin(), picture.gray.end());
    CHECK(*high - *low <= 3);
  }
}

TEST_CASE("The readings tell the display of the newest picture, and what its open part has",
          "[effects]") {
  SceneOf scene(kStraight + kVessel);
  Simulation session(*scene);
  // The field is 300 mm * 750 / 1050 / 4 wide at the isocenter, 40 mm along the wire, at its tip.
  constexpr double kHalfMm = 26.7857;
  double time_s = 0;
  double lao_rad = 0;
  const auto tick = [&](const Imaging& imaging, double left_mm, double head_mm, bool contrast) {
    Command command = Chosen(time_s += 0.1, imaging);
    command.controls.lao_rad = lao_rad;
    command.controls.table = {.left_mm = left_mm, .head_mm = head_mm};
    command.controls.contrast = contrast;
    Tick(session, command);
  };
  const auto read = [&] {
    return std::vector<double>{Reading(session, "picture_mode"),
                               Reading(session, "picture_instrument"),
                               Reading(session, "picture_contrast")};
  };
  using Readings = std::vector<double>;
  const auto is_unknown = [](double value) { return std::isnan(value); };
  CHECK(std::ranges::all_of(read(), is_unknown));
  Imaging narrow;
  narrow.magnification = 4;
  for (const double inside_mm : {0.5, -0.5}) {
    const double seen = inside_mm > 0 ? 1 : 0;
    // From behind, the same tip is at the other edge.
    for (const double side_rad : {0.0, std::numbers::pi}) {
      lao_rad = side_rad;
      tick(narrow, inside_mm - kHalfMm, 0, false);
      CHECK(read() == Readings{0, seen, 0});
    }
    lao_rad = 0;
    for (const double end : {1, -1}) {
      tick(narrow, 0, end * (kHalfMm - inside_mm), false);
      CHECK(read() == Readings{0, seen, 0});
    }
    // The patient's left is on the right: this shutter covers the part that has the wire.
    Imaging shut = narrow;
    shut.left = 0.25;
    tick(shut, inside_mm - kHalfMm / 2, 0, false);
    CHECK(read() == Readings{0, seen, 0});
  }
  narrow.mode = Imaging::Mode::kSubtraction;
  for (int k = 0; k < 20; ++k) tick(narrow, 0, 0, true);
  CHECK(read() == Readings{1, 1, 1});
  narrow.mode = Imaging::Mode::kRoadmap;
  tick(narrow, 0, kHalfMm + 3, true);  // farther than the radius of the vessel
  CHECK(read() == Readings{2, 0, 0});
  session.Restart();
  CHECK(std::ranges::all_of(read(), is_unknown));
}

TEST_CASE("The simulation itself refuses settings that cannot be chosen", "[effects]") {
  using torquer::simulator::IsValid;
  CHECK(IsValid(Imaging{}));
  const auto with = [](auto member, double value) {
    Imaging imaging;
    imaging.*member = value;
    return IsValid(imaging);
  };
  CHECK(with(&Imaging::pulses_per_s, 1));
  CHECK(with(&Imaging::pulses_per_s, 60));
  CHECK_FALSE(with(&Imaging::pulses_per_s, 0.5));
  CHECK_FALSE(with(&Imaging::pulses_per_s, -1));
  CHECK_FALSE(with(&Imaging::pulses_per_s, 61));
  CHECK_FALSE(with(&Imaging::pulses_per_s, std::nan("")));
  CHECK(with(&Imaging::magnification, 4));
  CHECK_FALSE(with(&Imaging::magnification, 0.99));
  CHECK_FALSE(with(&Imaging::magnification, 4.01));
  CHECK_FALSE(with(&Imaging::magnification, std::nan("")));
  for (const auto shutter : {&Imaging::left, &Imaging::right, &Imaging::top, &Imaging::bottom}) {
    CHECK(with(shutter, 0.45));
    CHECK_FALSE(with(shutter, 0.46));
    CHECK_FALSE(with(shutter, -0.01));
    CHECK_FALSE(with(shutter, std::nan("")));
  }
  Imaging unknown;
  unknown.mode = static_cast<Imaging::Mode>(5);
  CHECK_FALSE(IsValid(unknown));

  // A command is refused as a whole: the C-arm does not move either.
  SceneOf scene(kStraight + kVessel);
  Simulation session(*scene);
  Imaging imaging;
  imaging.magnification = 0;
  Command command = Chosen(0.1, imaging);
  Tick(session, command);
  CHECK(Reading(session, "xray_pulses") == 0);
  CHECK(Reading(session, "xray_field_mm") == Approx(300 * 750.0 / 1050));
}
