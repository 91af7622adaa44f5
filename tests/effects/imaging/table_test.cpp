// Moved table: positions and sizes in pictures against pinhole geometry, masks, dose.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "host/simulator/effects/imaging/picture_renderer.h"
#include "host/simulator/simulation.h"
#include "host/support/angles.h"
#include "tests/effects/vascular_scene.h"

using Eigen::Vector3d;
using torquer::kRadPerDeg;
using torquer::effects::DyePoints;
using torquer::effects::FluoroscopySettings;
using torquer::effects::ImageSource;
using torquer::effects::PictureRenderer;
using torquer::effects::Table;
using torquer::effects::WirePoint;
using torquer::effects::XrayFrame;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

constexpr double kSidMm = 1000, kSodMm = 700, kRadiusMm = 6;

FluoroscopySettings System() {
  FluoroscopySettings system;
  system.arm.isocenter_mm = {10, 20, 30};
  system.arm.sid_mm = kSidMm;
  system.arm.sod_mm = kSodMm;
  system.arm.detector_mm = 256;  // pixels of 1 mm
  system.arm.width = system.arm.height = 256;
  system.body.width_mm = 0;
  system.photons = 1e9;
  return system;
}

// A ball of metal as a stack of discs along the patient's axis.
std::vector<WirePoint> Ball(const Vector3d& center_mm) {
  std::vector<WirePoint> discs;
  constexpr int kDiscs = 60;
  for (int i = -kDiscs; i <= kDiscs; ++i) {
    const double z = kRadiusMm * i / kDiscs;
    discs.push_back({center_mm + Vector3d(0, 0, z), std::sqrt(kRadiusMm * kRadiusMm - z * z), 0.1});
  }
  return discs;
}

struct Spot {
  double column, row, diameter_px;
};

// Center and diameter of the dark spot of a picture. The integral of the gray over the spot is the
// ball's volume, magnified in two directions.
Spot SpotIn(const ImageSource::Picture& picture, const FluoroscopySettings& system) {
  const double background = picture.gray[0];
  double sum = 0, columns = 0, rows = 0;
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < picture.width; ++column) {
      const double dark =
          background - picture.gray[static_cast<std::size_t>(row * picture.width + column)];
      sum += dark;
      columns += dark * column;
      rows += dark * row;
    }
  }
  const double integral = sum / (255 * system.gain);  // of the attenuation, in pixels
  const double volume_mm3 = 4 * std::numbers::pi / 3 * std::pow(kRadiusMm, 3);
  const double px_per_mm = std::sqrt(integral / (0.1 * volume_mm3));
  return {columns / sum, rows / sum, 2 * kRadiusMm * px_per_mm};
}

Spot SpotAt(const Table& table, double lao_deg) {
  const FluoroscopySettings system = System();
  const DyePoints dye;
  PictureRenderer renderer(system, dye);
  XrayFrame frame;
  frame.controls.lao_rad = kRadPerDeg * lao_deg;
  frame.controls.table = table;
  frame.shadows = {Ball(system.arm.isocenter_mm)};
  ImageSource::Picture picture;
  renderer.Render(frame, picture);
  return SpotIn(picture, system);
}

constexpr std::array<Table, 7> kPlaces = {{{.left_mm = 0},
                                           {.left_mm = 40},
                                           {.head_mm = -50},
                                           {.height_mm = 120},
                                           {.height_mm = -140},
                                           {.left_mm = -20, .head_mm = 35, .height_mm = 60},
                                           {.left_mm = 25, .head_mm = 10, .height_mm = -90}}};

}  // namespace

TEST_CASE("A ball on the moved table has the place and the size of a pinhole camera", "[effects]") {
  constexpr double kMiddle = 127.5;
  for (const Table& table : kPlaces) {
    CAPTURE(table.left_mm, table.head_mm, table.height_mm);
    // At 0, 0 the source is below: a higher table is farther from it.
    const Spot front = SpotAt(table, 0);
    const double px_per_mm = kSidMm / (kSodMm + table.height_mm);
    CHECK(front.column == Approx(kMiddle + px_per_mm * table.left_mm).margin(0.1));
    CHECK(front.row == Approx(kMiddle - px_per_mm * table.head_mm).margin(0.1));
    CHECK(front.diameter_px == Approx(2 * kRadiusMm * px_per_mm).epsilon(0.01));

    // In LAO 90 the source is at the patient's right, and the patient's front is on the left. The
    // ball then leaves the picture at great heights.
    if (std::abs(table.height_mm) > 60) continue;
    const Spot side = SpotAt(table, 90);
    const double side_px_per_mm = kSidMm / (kSodMm + table.left_mm);
    CHECK(side.column == Approx(kMiddle - side_px_per_mm * table.height_mm).margin(0.1));
    CHECK(side.row == Approx(kMiddle - side_px_per_mm * table.head_mm).margin(0.1));
  }
}

TEST_CASE("A moved table gives pictures and dose of a C-arm that moved the other way",
          "[effects]") {
  const std::string system =
      "[effects.fluoroscopy]\nwidth_px = 96\nheight_px = 96\nbody_center_mm = [41, 5, 0]\n";
  SceneOf still(kStraight + system + "isocenter_mm = [41, 0, 0]\n");
  // LPS: 30 mm to the left, 20 mm to the head, 50 mm to the front.
  SceneOf moved(kStraight + system + "isocenter_mm = [11, 50, -20]\n");
  Simulation one(*still);
  Simulation other(*moved);
  for (int k = 1; k <= 20; ++k) {
    Command command;
    command.target[0].insertion_mm = 40;
    command.time_s = 0.01 * k;
    command.controls.xray = true;
    command.controls.lao_rad = k > 10 ? 0.3 : 0;
    torquer::CountedBudget budget(1000);
    other.Tick(command, budget);
    command.controls.table = {.left_mm = 30, .head_mm = 20, .height_mm = 50};
    one.Tick(command, budget);
    REQUIRE(one.picture_due() == other.picture_due());
    if (!one.picture_due()) continue;
    ImageSource::Picture picture;
    ImageSource::Picture expected;
    one.image()->Render(picture);
    other.image()->Render(expected);
    CHECK(picture.gray == expected.gray);
  }
  CHECK(Reading(one, "air_kerma_mGy") == Approx(Reading(other, "air_kerma_mGy")).epsilon(1e-12));
  CHECK(Reading(one, "table_left_mm") == 30);
  CHECK(Reading(one, "table_head_mm") == 20);
  CHECK(Reading(one, "table_height_mm") == 50);
}

TEST_CASE("A moved table takes the mask, which the readings tell", "[effects]") {
  SceneOf scene(kStraight +
                "attenuation_1_mm = 3\n[effects.fluoroscopy]\nwidth_px = 96\nheight_px = 96\n"
                "body_width_mm = 0\nphotons = 1e7\nmode = \"roadmap\"\n"
                "isocenter_mm = [30, 0, 0]\n");
  Simulation session(*scene);
  double time_s = 0;
  const auto take = [&](bool xray, const Table& table) {
    Command command;
    command.target[0].insertion_mm = 40;
    command.time_s = time_s += 0.1;
    command.controls.xray = xray;
    command.controls.table = table;
    torquer::CountedBudget budget(1000);
    session.Tick(command, budget);
  };
  const auto spread = [&] {
    ImageSource::Picture picture;
    session.image()->Render(picture);
    const auto [least, most] = std::minmax_element(picture.gray.begin(), picture.gray.end());
    return *most - *least;
  };
  take(true, {});
  CHECK(spread() <= 2);
  CHECK(std::isnan(Reading(session, "mask_lost_s")));
  // Without a new mask, the wire would stand in the picture twice.
  take(true, {.head_mm = 15});
  CHECK(spread() <= 2);
  CHECK(Reading(session, "mask_lost_s") == Approx(0.2));
  // At rest the mask stays, also while the pedal is up.
  take(false, {.head_mm = 15});
  take(true, {.head_mm = 15});
  CHECK(Reading(session, "mask_lost_s") == Approx(0.2));
  // It is lost while the pedal is up.
  take(false, {.head_mm = 15, .height_mm = 5});
  CHECK(Reading(session, "mask_lost_s") == Approx(0.5));
}
