#include "calibration/focus.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <map>
#include <numeric>

#include "host/support/error.h"

namespace torquer::calibration {
namespace {

// Below this SQUAL the reports count as doubtful, as in host/daemon.
constexpr int kPoorQuality = 16;
// Across the pipe. Flat targets under a real sensor have 1.00 to 1.12 there (README.md).
constexpr double kStrongShading = 1.25;
constexpr double kMuchDirt = 0.04;
constexpr double kDark = 0.15, kBright = 0.85;
constexpr double kMuchSaturated = 0.02;
constexpr double kNoContrast = 0.02;
// Dirt threshold, as a fraction of the fitted brightness. An area of radius kDirtRadius below it is
// dirt, not fiber.
constexpr double kDirtDepth = 0.18;
constexpr int kDirtRadius = 2;

// Value at the middle, slope along the pipe (column) and across it (row), a pixel each.
using Plane = std::array<double, 3>;

double FromMiddle(int index) { return index - (kFocusSide - 1) / 2.0; }

double At(const Plane& plane, int row, int column) {
  return plane[0] + plane[1] * FromMiddle(column) + plane[2] * FromMiddle(row);
}

// Least squares; the middle as origin makes the three unknowns independent.
Plane FitPlane(const std::vector<double>& picture) {
  Plane plane{};
  double squares = 0;
  for (int row = 0; row < kFocusSide; ++row) {
    for (int column = 0; column < kFocusSide; ++column) {
      const double value = picture[static_cast<std::size_t>(row * kFocusSide + column)];
      plane[0] += value / kFocusPixels;
      plane[1] += value * FromMiddle(column);
      plane[2] += value * FromMiddle(row);
      squares += FromMiddle(column) * FromMiddle(column);
    }
  }
  plane[1] /= squares;
  plane[2] /= squares;
  return plane;
}

std::vector<double> WithoutPlane(const std::vector<double>& picture, const Plane& plane) {
  std::vector<double> rest(picture.size());
  for (int i = 0; i < kFocusPixels; ++i) {
    const auto at = static_cast<std::size_t>(i);
    rest[at] = picture[at] - At(plane, i / kFocusSide, i % kFocusSide);
  }
  return rest;
}

// Mean over a square of 2 kDirtRadius + 1 pixels, cut off at the edges.
double AreaMean(const std::vector<double>& picture, int row, int column) {
  double sum = 0;
  int count = 0;
  for (int r = std::max(0, row - kDirtRadius); r <= std::min(kFocusSide - 1, row + kDirtRadius);
       ++r) {
    for (int c = std::max(0, column - kDirtRadius);
         c <= std::min(kFocusSide - 1, column + kDirtRadius); ++c) {
      sum += picture[static_cast<std::size_t>(r * kFocusSide + c)];
      ++count;
    }
  }
  return sum / count;
}

double Variance(const std::vector<double>& rest) {
  return std::inner_product(rest.begin(), rest.end(), rest.begin(), 0.0) / kFocusPixels;
}

// Half the mean square of the differences between neighbors, in both directions.
double NeighborVariance(const std::vector<double>& rest) {
  double sum = 0;
  for (int row = 0; row < kFocusSide; ++row) {
    for (int column = 1; column < kFocusSide; ++column) {
      const auto right = static_cast<std::size_t>(row * kFocusSide + column);
      const auto down = static_cast<std::size_t>(column * kFocusSide + row);
      sum += std::pow(rest[right] - rest[right - 1], 2);
      sum += std::pow(rest[down] - rest[down - kFocusSide], 2);
    }
  }
  return sum / (4.0 * kFocusSide * (kFocusSide - 1));
}

void RequirePictures(std::span<const FocusPicture> pictures) {
  if (pictures.empty()) throw UserError("no picture of the sensor to judge; take one first");
  for (const FocusPicture& picture : pictures) {
    const bool whole = picture.size() == kFocusPixels;
    if (!whole || *std::max_element(picture.begin(), picture.end()) > kFocusWhite) {
      throw UserError(
          "a picture of the sensor has " + std::to_string(picture.size()) +
          (whole ? " pixels, but one above 127" : " pixels where it has 1296") +
          "; the device's firmware and this program are not compatible; run torquer-flash");
    }
  }
}

std::string Said(const char* format, double value) {
  char text[240];
  std::snprintf(text, sizeof(text), format, value);
  return text;
}

}  // namespace

FocusFigures MeasureFocus(std::span<const FocusPicture> pictures) {
  RequirePictures(pictures);
  FocusFigures figures;
  std::vector<double> mean(kFocusPixels);
  double variance = 0, neighbors = 0;
  for (const FocusPicture& pixels : pictures) {
    const std::vector<double> picture(pixels.begin(), pixels.end());
    const std::vector<double> rest = WithoutPlane(picture, FitPlane(picture));
    variance += Variance(rest) / static_cast<double>(pictures.size());
    neighbors += NeighborVariance(rest) / static_cast<double>(pictures.size());
    for (std::size_t i = 0; i < picture.size(); ++i) {
      mean[i] += picture[i] / static_cast<double>(pictures.size());
      const bool extreme = pixels[i] == 0 || pixels[i] == kFocusWhite;
      figures.saturated +=
          extreme ? 1.0 / (kFocusPixels * static_cast<double>(pictures.size())) : 0;
    }
  }
  const Plane plane = FitPlane(mean);
  const double middle = plane[0];
  figures.brightness = middle / kFocusWhite;
  if (middle <= 0) return figures;

  const auto ratio = [middle](double slope) {
    const double rise = std::min(std::abs(slope) * (kFocusSide - 1) / 2, 0.98 * middle);
    return (middle + rise) / (middle - rise);
  };
  figures.shading_along = ratio(plane[1]);
  figures.shading_across = ratio(plane[2]);
  figures.contrast = std::sqrt(variance) / middle;
  // Rounding to whole numbers adds this variance to both; it is not a property of the paper.
  constexpr double kRounding = 1.0 / 12;
  if (variance > 2 * kRounding) {
    figures.sharpness = std::max(0.0, neighbors - kRounding) / (variance - kRounding);
  }

  const std::vector<double> rest = WithoutPlane(mean, plane);
  int dark = 0;
  for (int i = 0; i < kFocusPixels; ++i) {
    const int row = i / kFocusSide, column = i % kFocusSide;
    dark += AreaMean(rest, row, column) < -kDirtDepth * std::max(0.0, At(plane, row, column));
  }
  figures.dirt = static_cast<double>(dark) / kFocusPixels;
  return figures;
}

FocusVerdict JudgeFocus(std::span<const FocusPicture> pictures, int surface_quality) {
  FocusVerdict verdict;
  verdict.figures = MeasureFocus(pictures);
  const FocusFigures& seen = verdict.figures;
  std::vector<std::string>& found = verdict.findings;
  if (seen.brightness < kDark) {
    found.push_back(
        Said("The picture is dark (%.0f %% of white): the lens is not over the window, "
             "or the LED does not light.",
             100 * seen.brightness));
  } else if (seen.brightness > kBright || seen.saturated > kMuchSaturated) {
    found.push_back(
        Said("The picture is too bright (%.0f %% of its pixels black or white): the "
             "surface shines; use matt paper.",
             100 * seen.saturated));
  } else if (seen.contrast < kNoContrast) {
    found.emplace_back(
        "The picture shows nothing: there is no paper at this height, or it is far out of focus.");
  } else {
    if (seen.dirt > kMuchDirt) {
      found.push_back(
          Said("%.0f %% of the view stays dark wherever the cylinder is: clean lens and "
               "window, look for glue and for the window's edge.",
               100 * seen.dirt));
    }
    if (seen.shading_across > kStrongShading) {
      found.push_back(
          Said("One side of the view is %.2f times as bright as the other, across the pipe: light "
               "falls from the side, or the board is turned, or the lens is beside the crest.",
               seen.shading_across));
    }
  }
  if (surface_quality < kPoorQuality) {
    found.push_back(Said(
        "The surface has too little texture for the sensor (surface %.0f; 16 or more is needed).",
        surface_quality));
  }
  verdict.good = found.empty();
  if (verdict.good) {
    found.push_back(Said("Clean and evenly lit across the pipe; surface %.0f.", surface_quality));
  }
  return verdict;
}

FocusSearch FindFocus(std::span<const FocusHeight> heights) {
  if (heights.empty()) throw UserError("no height to judge; take a picture first");
  std::map<double, double> sharpness;
  for (const FocusHeight& height : heights) {
    if (!(height.shims_mm >= 0 && height.sharpness >= 0) || !std::isfinite(height.shims_mm) ||
        !std::isfinite(height.sharpness)) {
      throw UserError(fmt::format(
          "shims of {:g} mm with sharpness {:g}: give numbers that are finite and 0 or more",
          height.shims_mm, height.sharpness));
    }
    sharpness[height.shims_mm] = height.sharpness;
  }
  const auto best =
      std::max_element(sharpness.begin(), sharpness.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  FocusSearch search;
  if (best == sharpness.begin() || std::next(best) == sharpness.end()) {
    const bool more = std::next(best) == sharpness.end() && best->first > 0;
    const bool alone = sharpness.size() == 1;
    search.advice = fmt::format(
        "Sharpest so far with shims of {:.2f} mm: take a picture with {} too.", best->first,
        alone             ? "more and with less"
        : more            ? "more"
        : best->first > 0 ? "less"
                          : "more, or lower the carrier");
    return search;
  }
  // Parabola through three points: vertex where the slope of the interpolation is 0.
  const auto below = std::prev(best), above = std::next(best);
  const double rise = (best->second - below->second) / (best->first - below->first);
  const double fall = (above->second - best->second) / (above->first - best->first);
  const double bend = (fall - rise) / (above->first - below->first);
  const double middle = (below->first + best->first) / 2;
  search.best_shims_mm = bend < 0 ? middle - rise / (2 * bend) : best->first;
  const double now_mm = heights.back().shims_mm;
  search.in_focus = std::abs(now_mm - *search.best_shims_mm) <= kFocusTolerance_mm + 1e-9;
  search.advice = search.in_focus
                      ? fmt::format("In focus: the surface is sharpest with shims of {:.2f} mm.",
                                    *search.best_shims_mm)
                      : fmt::format(
                            "The surface is sharpest with shims of {:.2f} mm: change them "
                            "from {:.2f} mm and look again.",
                            *search.best_shims_mm, now_mm);
  return search;
}

}  // namespace torquer::calibration
