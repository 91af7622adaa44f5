// The wedge filters of the X-ray system: their shadows, and the dose.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>
#include <vector>

#include "host/simulator/command_limits.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"
#include "host/simulator/simulation.h"
#include "tests/effects/vascular_scene.h"

using torquer::effects::ImageSource;
using torquer::effects::Imaging;
using torquer::effects::Wedge;
using torquer::simulator::Command;
using torquer::simulator::Simulation;
using torquer::test::kStraight;
using torquer::test::Reading;
using torquer::test::SceneOf;

namespace {

// 0.5 mm of copper of 8.96 g/cm^3. At 60 keV NIST gives 1.593 cm^2/g.
constexpr double kFull = 0.05 * 1.593 * 8.96;
constexpr double kRamp = 0.1;

// Bare field, so that every pixel has the same gray without a wedge.
std::string Field(int width_px, int height_px, const std::string& more) {
  return kStraight + "[effects.fluoroscopy]\nwidth_px = " + std::to_string(width_px) +
         "\nheight_px = " + std::to_string(height_px) +
         "\nbody_width_mm = 0\nisocenter_mm = [400, 0, 0]\n" + more;
}

Command CommandFor(double time_s, const Imaging& imaging) {
  Command command;
  command.target[0].insertion_mm = 1;
  command.time_s = time_s;
  command.controls.xray = true;
  command.controls.imaging = imaging;
  return command;
}

ImageSource::Picture PictureOf(Simulation& session, double time_s, const Imaging& imaging) {
  torquer::CountedBudget budget(3000);
  session.Tick(CommandFor(time_s, imaging), budget);
  ImageSource::Picture picture;
  session.image()->Render(picture);
  return picture;
}

int GrayAt(const ImageSource::Picture& picture, int column, int row) {
  return picture.gray[static_cast<std::size_t>(row * picture.width + column)];
}

Imaging With(const Wedge& left, const Wedge& right, double magnification = 1) {
  Imaging imaging;
  imaging.wedges = {left, right};
  imaging.magnification = magnification;
  return imaging;
}

// Share of the full attenuation at a distance behind the edge, in widths of the picture.
double Ramp(double behind, double magnification) {
  return std::min(std::max(behind, 0.0) / (kRamp * magnification), 1.0);
}

// A plain picture shows 60 % of slow changes; `gain` is 0.4.
constexpr double kGrayPerLog = 255 * 0.4 * 0.6;

// Largest deviation of the grays from those of `integral` in a field of 128 x 96.
template <class Integral>
double Deviation(const Imaging& imaging, Integral integral) {
  SceneOf scene(Field(128, 96, "photons = 1e6\n"));
  Simulation session(*scene);
  const ImageSource::Picture picture = PictureOf(session, 0.1, imaging);
  double worst = 0;
  for (int row = 0; row < picture.height; ++row) {
    for (int column = 0; column < picture.width; ++column) {
      const double expected =
          255 * 0.56 - kGrayPerLog * integral((column + 0.5) / 128, (row + 0.5) / 128);
      worst = std::max(worst, std::abs(GrayAt(picture, column, row) - expected));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("Behind a wedge the intensity is that of its copper, with a linear ramp at its edge",
          "[effects]") {
  // Noise of about a gray level makes means finer than the levels.
  SceneOf scene(Field(128, 96, "photons = 5e3\nscatter_to_primary = 2\n"));
  Simulation session(*scene);
  const ImageSource::Picture open = PictureOf(session, 0.1, {});
  const ImageSource::Picture wedged = PictureOf(session, 0.2, With({0.5, 0}, {}));
  // Mean ratio of the intensities in 50 columns.
  const auto transmission = [&](int first) {
    double sum = 0;
    for (int row = 0; row < 96; ++row) {
      for (int column = first; column < first + 50; ++column) {
        sum += GrayAt(wedged, column, row) - GrayAt(open, column, row);
      }
    }
    return std::exp(sum / (50 * 96) / kGrayPerLog);
  };
  CHECK(transmission(0) == Approx(std::exp(-kFull)).epsilon(0.003));
  CHECK(std::exp(-kFull) == Approx(0.49).margin(0.001));
  CHECK(transmission(70) == Approx(1).epsilon(0.003));

  for (const double magnification : {1.0, 2.0}) {
    CHECK(Deviation(With({0.3, 0}, {}, magnification),
                    [&](double x, double) { return kFull * Ramp(0.3 - x, magnification); }) < 1);
    CHECK(Deviation(With({}, {0.4, 0}, magnification),
                    [&](double x, double) { return kFull * Ramp(x - 0.6, magnification); }) < 1);
  }
  CHECK(Deviation({}, [](double, double) { return 0; }) < 1);
}

TEST_CASE("A wedge turns clockwise about the picture's middle", "[effects]") {
  // The height is 0.75 of the width.
  CHECK(Deviation(With({0.5, 90}, {}),
                  [](double, double y) { return kFull * Ramp(0.375 - y, 1); }) < 1);
  CHECK(Deviation(With({}, {0.2, 90}), [](double, double y) { return kFull * Ramp(y - 0.6, 1); }) <
        1);
  CHECK(Deviation(With({0.2, -90}, {}), [](double, double y) { return kFull * Ramp(y - 0.6, 1); }) <
        1);
  // With 3-4-5 the picture is 0.8 + 0.6 * 0.75 wide across the edge, from its top left corner.
  const double turn_deg = std::atan2(3, 4) * 180 / std::acos(-1.0);
  const double span = 0.8 + 0.6 * 0.75;
  CHECK(Deviation(With({0.3, turn_deg}, {0.4, turn_deg}), [&](double x, double y) {
          const double from_corner = 0.8 * x + 0.6 * y;
          return kFull * (Ramp(0.3 * span - from_corner, 1) + Ramp(from_corner - 0.6 * span, 1));
        }) < 1);
}

TEST_CASE("Behind a wedge the noise is that of fewer photons", "[effects]") {
  SceneOf scene(Field(128, 128, "photons = 600\n"));
  Simulation session(*scene);
  const ImageSource::Picture picture = PictureOf(session, 0.1, With({0.5, 0}, {}));
  const auto deviation = [&](int first) {
    double sum = 0;
    double squares = 0;
    const int count = 50 * 128;
    for (int row = 0; row < 128; ++row) {
      for (int column = first; column < first + 50; ++column) {
        const double gray = GrayAt(picture, column, row);
        sum += gray;
        squares += gray * gray;
      }
    }
    return std::sqrt(squares / count - sum * sum / count / count);
  };
  CHECK(deviation(0) / deviation(70) == Approx(std::exp(kFull / 2)).epsilon(0.05));
}

TEST_CASE("A subtraction shows wedges that moved since its mask, and shutters cover them",
          "[effects]") {
  SceneOf scene(Field(128, 96, "photons = 1e6\nmode = \"subtraction\"\n"));
  Simulation session(*scene);
  const auto spread = [](const ImageSource::Picture& picture) {
    const auto [low, high] = std::minmax_element(picture.gray.begin(), picture.gray.end());
    return *high - *low;
  };
  Imaging imaging = With({0.3, 20}, {});
  CHECK(spread(PictureOf(session, 0.1, imaging)) <= 3);
  CHECK(spread(PictureOf(session, 0.2, imaging)) <= 3);
  // 1.5 times the gain of a plain picture, and without its compression.
  const ImageSource::Picture open = PictureOf(session, 0.3, {});
  CHECK(GrayAt(open, 5, 5) - GrayAt(open, 100, 80) ==
        Approx(std::min(255 * 0.4 * 1.5 * kFull, 255 - 255 * 0.78)).margin(3));
  imaging.left = 0.25;
  const ImageSource::Picture shut = PictureOf(session, 0.4, imaging);
  CHECK(GrayAt(shut, 5, 5) == 0);
  CHECK(GrayAt(shut, 31, 90) == 0);
  CHECK(GrayAt(shut, 33, 5) > 100);
  // The next press takes a new mask, without wedges.
  CHECK(spread(PictureOf(session, 0.5, {})) > 50);
  Command released = CommandFor(0.55, {});
  released.controls.xray = false;
  torquer::CountedBudget budget(3000);
  session.Tick(released, budget);
  CHECK(spread(PictureOf(session, 0.6, {})) <= 3);
}

namespace {

struct Kerma {
  double kerma_mGy, area_Gy_cm2;
};

// Sums at the end of each setting, which stays for 0.2 s with the pedal down.
std::vector<Kerma> KermaOfAll(const std::vector<Imaging>& settings) {
  SceneOf scene(Field(64, 64, ""));
  Simulation session(*scene);
  std::vector<Kerma> sums;
  int tick = 0;
  for (const Imaging& imaging : settings) {
    for (int k = 0; k < 20; ++k) {
      torquer::CountedBudget budget(3000);
      session.Tick(CommandFor(0.01 * ++tick, imaging), budget);
    }
    sums.push_back({Reading(session, "air_kerma_mGy"), Reading(session, "kerma_area_Gy_cm2")});
  }
  return sums;
}

Kerma KermaOf(const Imaging& imaging) { return KermaOfAll({imaging})[0]; }

// Mean over the picture of the transmission of one wedge, by its edge's distance from where it came
// in. `length`: of the picture parallel to the edge, at a distance from there.
template <class Length>
double MeanTransmission(double edge, double magnification, Length length) {
  constexpr int kSteps = 20000;
  double covered = 0;
  for (int k = 0; k < kSteps; ++k) {
    const double from_side = edge * (k + 0.5) / kSteps;
    covered += edge / kSteps * length(from_side) *
               (1 - std::exp(-kFull * Ramp(edge - from_side, magnification)));
  }
  return 1 - covered;
}

}  // namespace

TEST_CASE("A wedge takes its part from the kerma-area product alone", "[effects]") {
  const Kerma open = KermaOf({});
  const auto share = [&](const Imaging& imaging) {
    const Kerma dose = KermaOf(imaging);
    Imaging without = imaging;
    without.wedges = {};
    const Kerma bare = KermaOf(without);
    CHECK(dose.kerma_mGy == bare.kerma_mGy);
    return dose.area_Gy_cm2 / bare.area_Gy_cm2;
  };
  CHECK(open.area_Gy_cm2 > 0);
  const double through = std::exp(-kFull);
  const double ramp = (1 - through) / kFull;  // mean of a whole ramp
  CHECK(share(With({0.3, 0}, {})) ==
        Approx(0.7 + kRamp * ramp + (0.3 - kRamp) * through).epsilon(1e-3));
  CHECK(share(With({0.3, 0}, {0.4, 0})) ==
        Approx(0.3 + 2 * kRamp * ramp + (0.7 - 2 * kRamp) * through).epsilon(1e-3));
  CHECK(share(With({0.3, -90}, {}, 2)) ==
        Approx(0.7 + 2 * kRamp * ramp + (0.3 - 2 * kRamp) * through).epsilon(1e-3));
  CHECK(share(With({}, {0.4, 45})) ==
        Approx(MeanTransmission(0.4 * std::sqrt(2.0), 1, [](double from_corner) {
          return 2 * from_corner;
        })).epsilon(1e-3));

  // The beam is that between the shutters.
  Imaging shut = With({0.3, 0}, {});
  shut.left = 0.1;
  shut.top = 0.4;
  CHECK(share(shut) == Approx((0.7 + kRamp * ramp + (0.2 - kRamp) * through) / 0.9).epsilon(1e-3));
}

TEST_CASE("A wedge that moves while the pedal is down counts from its new place", "[effects]") {
  const Imaging settings[] = {With({0.1, 0}, {}), With({0.4, 0}, {}), With({0.4, 30}, {})};
  const std::vector<Kerma> sums = KermaOfAll({settings[0], settings[1], settings[2]});
  for (std::size_t k = 1; k < 3; ++k) {
    const Kerma alone = KermaOf(settings[k]);
    CHECK((sums[k].area_Gy_cm2 - sums[k - 1].area_Gy_cm2) /
              (sums[k].kerma_mGy - sums[k - 1].kerma_mGy) ==
          Approx(alone.area_Gy_cm2 / alone.kerma_mGy).epsilon(1e-9));
  }
}

TEST_CASE("Both planes of a biplane system have the same wedges", "[effects]") {
  const std::string text = Field(96, 96, "photons = 1e6\n[effects.lateral_plane]\n");
  SceneOf scenes[] = {SceneOf(text), SceneOf(text)};
  Simulation open(*scenes[0]);
  Simulation wedged(*scenes[1]);
  torquer::CountedBudget budget(3000);
  open.Tick(CommandFor(0.1, {}), budget);
  wedged.Tick(CommandFor(0.1, With({0.4, 0}, {})), budget);
  for (const std::size_t plane : {0U, 1U}) {
    ImageSource::Picture before, after;
    open.image(plane)->Render(before);
    wedged.image(plane)->Render(after);
    CHECK(GrayAt(before, 10, 50) - GrayAt(after, 10, 50) == Approx(kGrayPerLog * kFull).margin(2));
    CHECK(GrayAt(before, 60, 50) - GrayAt(after, 60, 50) == Approx(0).margin(2));
  }
  const double share = 0.6 + kRamp * (1 - std::exp(-kFull)) / kFull + 0.3 * std::exp(-kFull);
  for (const char* const name : {"kerma_area_Gy_cm2", "lateral_kerma_area_Gy_cm2"}) {
    CHECK(Reading(wedged, name) == Approx(share * Reading(open, name)).epsilon(1e-3));
  }
}

TEST_CASE("The simulation itself refuses places that a wedge cannot have", "[effects]") {
  using torquer::simulator::IsValid;
  CHECK(IsValid(With({0.5, 90}, {0.5, -90})));
  for (const Wedge& bad : {Wedge{-0.01, 0}, Wedge{0.51, 0}, Wedge{std::nan(""), 0}, Wedge{0.1, 91},
                           Wedge{0.1, -91}, Wedge{0.1, std::nan("")}}) {
    CHECK_FALSE(IsValid(With(bad, {})));
    CHECK_FALSE(IsValid(With({}, bad)));
  }
}
