// Focus verdict on synthetic pictures, whose properties are known exactly.
#include "calibration/focus.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "host/support/error.h"

namespace torquer::calibration {
namespace {

using Catch::Contains;

FocusPicture Draw(const std::function<double(int row, int column)>& brightness) {
  FocusPicture picture;
  for (int row = 0; row < kFocusSide; ++row) {
    for (int column = 0; column < kFocusSide; ++column) {
      picture.push_back(static_cast<std::uint8_t>(std::lround(brightness(row, column))));
    }
  }
  return picture;
}

FocusFigures Measure(const FocusPicture& picture) {
  return MeasureFocus(std::vector<FocusPicture>{picture});
}

/// Fibers as fine as pixels.
FocusPicture Noise(std::uint32_t seed, double mean = 62, double deviation = 12) {
  std::mt19937 random(seed);
  std::normal_distribution<double> fibers(mean, deviation);
  return Draw([&](int, int) { return std::clamp(fibers(random), 1.0, 126.0); });
}

/// Fibers of `width` pixels, with no sharp edge.
FocusPicture Waves(double width) {
  return Draw([width](int row, int column) {
    const double k = std::numbers::pi / width;
    return 62 + 10 * std::sin(k * row) * std::cos(k * column);
  });
}

TEST_CASE("shading is the ratio of the edges, along the pipe and across it") {
  struct Way {
    double along, across;
  };
  for (const Way& way : {Way{1, 0}, Way{-1, 0}, Way{0, 1}, Way{0, -1}}) {
    // Brightness rises from 40 on one edge to 80 on the other. A line of the picture is along the
    // pipe.
    const FocusFigures figures = Measure(Draw([&way](int row, int column) {
      return 60 + 20 * (way.along * (column - 17.5) + way.across * (row - 17.5)) / 17.5;
    }));
    CHECK(figures.shading_along == Approx(way.along != 0 ? 2.0 : 1.0).epsilon(0.01));
    CHECK(figures.shading_across == Approx(way.across != 0 ? 2.0 : 1.0).epsilon(0.01));
    CHECK(figures.brightness == Approx(60.0 / 127).epsilon(0.01));
    CHECK(figures.contrast < 0.01);
    CHECK(figures.dirt == 0);
  }
  CHECK(Measure(Draw([](int, int) { return 60; })).shading_across == Approx(1));
  // A black edge must not cause a division by zero.
  const FocusFigures black =
      Measure(Draw([](int, int column) { return std::max(0.0, 100 * (column - 25) / 10.0); }));
  CHECK(std::isfinite(black.shading_along));
}

TEST_CASE("sharpness is 2 for a chessboard, 1 for noise, and falls with the width of the fibers") {
  const auto chess = [](int size) {
    return Draw([size](int row, int column) { return (row / size + column / size) % 2 ? 80 : 44; });
  };
  CHECK(Measure(chess(1)).sharpness == Approx(2).epsilon(0.02));
  CHECK(Measure(chess(2)).sharpness == Approx(1).epsilon(0.1));
  CHECK(Measure(Noise(1)).sharpness == Approx(1).epsilon(0.1));
  double before = 1;
  for (const double width : {3.0, 5.0, 8.0, 12.0}) {
    const double sharpness = Measure(Waves(width)).sharpness;
    CHECK(sharpness < before);
    before = sharpness;
  }
  // Neither contrast nor light from one side changes the sharpness.
  CHECK(Measure(Noise(1, 62, 6)).sharpness == Approx(1).epsilon(0.1));
  const FocusPicture noise = Noise(1);
  const FocusPicture lit = Draw([&noise](int row, int column) {
    return noise[static_cast<std::size_t>(row * kFocusSide + column)] *
           (1 + 0.015 * (column - 17.5));
  });
  CHECK(Measure(lit).sharpness == Approx(Measure(noise).sharpness).epsilon(0.1));
  // Rounding noise on an even surface has no sharpness.
  CHECK(Measure(Draw([](int row, int column) {
          return (row * 7 + column * 3) % 5 ? 60 : 61;
        })).sharpness == 0);
}

std::vector<FocusPicture> WithSpot(int pictures, int size, bool stays) {
  std::vector<FocusPicture> all;
  for (int i = 0; i < pictures; ++i) {
    FocusPicture picture = Noise(static_cast<std::uint32_t>(i + 1), 62, 8);
    const int at = stays ? 12 : 2 + 9 * (i % 3);
    for (int row = at; row < at + size; ++row) {
      for (int column = at; column < at + size; ++column) {
        std::uint8_t& pixel = picture[static_cast<std::size_t>(row * kFocusSide + column)];
        pixel = static_cast<std::uint8_t>(pixel / 3);
      }
    }
    all.push_back(picture);
  }
  return all;
}

TEST_CASE("a spot that is dark at the same place in every picture is dirt") {
  CHECK(MeasureFocus(WithSpot(6, 10, true)).dirt == Approx(100.0 / 1296).epsilon(0.4));
  CHECK(MeasureFocus(WithSpot(6, 18, true)).dirt == Approx(324.0 / 1296).epsilon(0.4));
  CHECK(MeasureFocus(WithSpot(6, 0, true)).dirt == 0);
  const std::vector<FocusPicture> one = WithSpot(1, 8, true);
  CHECK(MeasureFocus(one).dirt > 0.02);
}

TEST_CASE("the verdict names problems, most important first") {
  const auto judge = [](const FocusPicture& picture, int quality = 64) {
    return JudgeFocus(std::vector<FocusPicture>{picture}, quality);
  };
  const FocusVerdict good = judge(Noise(3, 62, 10));
  CHECK(good.good);
  REQUIRE(good.findings.size() == 1);
  CHECK_THAT(good.findings[0], Contains("Clean and evenly lit") && Contains("64"));

  CHECK_THAT(judge(Draw([](int, int) { return 5; })).findings[0], Contains("dark"));
  CHECK_THAT(judge(Draw([](int, int) { return 60; })).findings[0], Contains("shows nothing"));
  CHECK_THAT(judge(Draw([](int row, int) { return row < 20 ? 127 : 60; })).findings[0],
             Contains("too bright"));
  const FocusVerdict several = judge(
      Draw([](int row, int column) {
        return (62 + 9 * std::sin(row / 4.0) * std::cos(column / 4.0)) * (1 + 0.02 * (row - 17.5));
      }),
      9);
  CHECK_FALSE(several.good);
  REQUIRE(several.findings.size() == 2);
  CHECK_THAT(several.findings[0], Contains("times as bright") && Contains("across the pipe"));
  CHECK_THAT(several.findings[1], Contains("surface 9"));
  CHECK_FALSE(judge(Noise(3, 62, 10), 15).good);
  CHECK(judge(Noise(3, 62, 10), 16).good);
}

TEST_CASE("the focus is the maximum of sharpness over the shims") {
  const auto search = [](std::vector<FocusHeight> heights) { return FindFocus(heights); };
  // One height, or a maximum at the end, gives no result.
  const FocusSearch alone = search({{0.4, 0.4}});
  CHECK_FALSE(alone.best_shims_mm);
  CHECK_THAT(alone.advice, Contains("more and with less"));
  CHECK_THAT(search({{0.2, 0.2}, {0.4, 0.3}}).advice, Contains("0.40 mm") && Contains("with more"));
  CHECK_THAT(search({{0.2, 0.3}, {0.4, 0.2}}).advice, Contains("0.20 mm") && Contains("with less"));
  CHECK_THAT(search({{0.0, 0.3}, {0.4, 0.2}}).advice, Contains("lower the carrier"));
  // A parabola is found exactly, in any order and with uneven steps.
  const auto at = [](double mm, double scale) {
    return FocusHeight{mm, scale * (0.43 - 1.5 * (mm - 0.37) * (mm - 0.37))};
  };
  for (const double scale : {1.0, 0.2}) {  // another surface: as sharp as a fifth
    const FocusSearch found =
        search({at(0.6, scale), at(0.0, scale), at(0.2, scale), at(0.3, scale)});
    REQUIRE(found.best_shims_mm);
    CHECK(*found.best_shims_mm == Approx(0.37));
    CHECK_FALSE(found.in_focus);  // 0.07 mm off
  }
  CHECK(search({at(0.6, 1), at(0.0, 1), at(0.4, 1)}).in_focus);
  CHECK_FALSE(search({at(0.4, 1), at(0.0, 1), at(0.6, 1)}).in_focus);
  // A height that was taken again counts by its last value.
  CHECK_FALSE(search({{0.2, 0.2}, {0.4, 0.4}, {0.6, 0.2}, {0.6, 0.5}}).best_shims_mm);
  CHECK_THROWS_AS(search({}), UserError);
  CHECK_THROWS_WITH(search({{-0.2, 0.3}}), Contains("-0.2 mm"));
  CHECK_THROWS_AS(search({{0.2, std::nan("")}}), UserError);
}

TEST_CASE("a file that is not a picture is refused") {
  CHECK_THROWS_AS(MeasureFocus({}), UserError);
  CHECK_THROWS_WITH(MeasureFocus(std::vector<FocusPicture>{FocusPicture(1295, 60)}),
                    Contains("1295 pixels"));
  FocusPicture bright(kFocusPixels, 60);
  bright[700] = 128;
  CHECK_THROWS_WITH(MeasureFocus(std::vector<FocusPicture>{bright}), Contains("above 127"));
  // An all-black picture is valid.
  CHECK(MeasureFocus(std::vector<FocusPicture>{FocusPicture(kFocusPixels, 0)}).brightness == 0);
  CHECK_FALSE(JudgeFocus(std::vector<FocusPicture>{FocusPicture(kFocusPixels, 0)}, 0).good);
}

}  // namespace
}  // namespace torquer::calibration
