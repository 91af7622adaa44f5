// Optics of the virtual sensor against figures of a real one. Tested are the lamp's shading, the
// sharpness by height and the pixel order. The former verdict, which judged one picture, fails on
// them.
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "calibration/focus.h"
#include "host/emulator/surface_picture.h"

namespace torquer::emulator {
namespace {

calibration::FocusFigures Figures(const SurfaceOptics& optics, std::uint32_t seed) {
  std::vector<calibration::FocusPicture> pictures;
  for (int i = 0; i < 4; ++i) {
    const SurfacePicture picture = RenderSurface(1.7 * i, 2.3 * i, optics, seed);
    pictures.emplace_back(picture.begin(), picture.end());
  }
  return calibration::MeasureFocus(pictures);
}

// Verdict before the focus was sought over shims: one limit for shading in any direction, and one
// for sharpness.
bool FormerlyGood(const calibration::FocusFigures& figures) {
  const auto rise = [](double ratio) { return (ratio - 1) / (ratio + 1); };
  const double both = std::hypot(rise(figures.shading_along), rise(figures.shading_across));
  return (1 + both) / (1 - both) <= 1.35 && figures.sharpness >= 0.10;
}

}  // namespace

TEST_CASE("the lamp shades flat targets along the pipe, as in pictures of a real sensor") {
  for (const double ratio : {1.23, 1.51}) {
    const calibration::FocusFigures seen = Figures({.lamp_shading = ratio}, 3);
    CHECK(seen.shading_along == Approx(ratio).epsilon(0.04));
    CHECK(seen.shading_across < 1.12);
  }
}

TEST_CASE("sharpness falls with the height as in pictures of a real sensor") {
  for (std::uint32_t seed = 1; seed <= 5; ++seed) {
    CHECK(Figures({.distance_mm = 2.4}, seed).sharpness == Approx(0.43).margin(0.03));
    CHECK(Figures({.distance_mm = 2.7}, seed).sharpness == Approx(0.27).margin(0.03));
    CHECK(Figures({.distance_mm = 3.0}, seed).sharpness == Approx(0.11).margin(0.03));
  }
}

TEST_CASE("the former verdict refuses a good build and passes one that is 0.6 mm too high") {
  const SurfaceOptics good{.lamp_shading = 1.51};
  CHECK_FALSE(FormerlyGood(Figures(good, 2)));
  SurfaceOptics high{.distance_mm = 3.0, .lamp_shading = 1.23};
  CHECK(FormerlyGood(Figures(high, 2)));

  // The focus over shims: any surface, lamp and offset of the carrier, in steps of 0.2 mm.
  for (std::uint32_t seed = 1; seed <= 10; ++seed) {
    const double offset_mm = 0.04 * seed;  // shims at which the height is that of the focus
    std::vector<calibration::FocusHeight> heights;
    for (const double shims_mm : {0.0, 0.2, 0.4, 0.6}) {
      const SurfaceOptics optics{.distance_mm = kNominalDistance_mm + shims_mm - offset_mm,
                                 .magnification_per_mm = -0.13,
                                 .lamp_shading = 1.2 + 0.03 * seed};
      heights.push_back({shims_mm, Figures(optics, seed).sharpness});
    }
    const calibration::FocusSearch found = calibration::FindFocus(heights);
    CAPTURE(seed, offset_mm, found.advice);
    if (found.best_shims_mm) {
      CHECK(*found.best_shims_mm == Approx(offset_mm).margin(calibration::kFocusTolerance_mm));
      CHECK(found.in_focus == (std::abs(0.6 - *found.best_shims_mm) <= 0.05 + 1e-9));
    } else {
      CHECK(offset_mm < 0.12);  // the maximum is at the lowest height, so less shims are asked for
    }
  }
}

TEST_CASE("bytes of a picture rise along y, then along x") {
  // Light along y alone: each line of 36 bytes has the whole slope, and all lines are alike.
  const SurfacePicture lit = RenderSurface(0, 0, {.lamp_shading = 3}, 4);
  std::array<double, 2> low{}, high{};
  for (std::size_t i = 0; i < lit.size(); ++i) {
    const std::size_t y = i % kPictureSide, x = i / kPictureSide;
    if (y < 6) low[0] += lit[i];
    if (y >= 30) high[0] += lit[i];
    if (x < 6) low[1] += lit[i];
    if (x >= 30) high[1] += lit[i];
  }
  CHECK(high[0] / low[0] == Approx(2.5).margin(0.3));
  CHECK(high[1] / low[1] == Approx(1.0).margin(0.1));
}

}  // namespace torquer::emulator
