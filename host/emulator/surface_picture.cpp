#include "host/emulator/surface_picture.h"

#include <algorithm>
#include <cmath>

namespace torquer::emulator {
namespace {

constexpr double kView_mm = 1.0;  // side of the sensor's view, at a magnification of 1:1
constexpr double kFiber_mm = 0.048;
// Radius of the blur for each millimeter out of focus. With it and the fibers' width, the sharpness
// (calibration/focus.h) falls as in pictures of a real part. Values there: 0.43 in focus, 0.27 at
// +0.3 mm, 0.11 at +0.6.
constexpr double kBlur_mm_per_mm = 0.10;
constexpr double kMean = 62, kContrast = 26;

// A number from -1 to 1 for each cell of the paper.
double Noise(int x, int y, std::uint32_t seed) {
  std::uint32_t h = seed * 0x9e3779b1u ^ static_cast<std::uint32_t>(x) * 0x85ebca6bu ^
                    static_cast<std::uint32_t>(y) * 0xc2b2ae35u;
  h ^= h >> 15;
  h *= 0x2c1b3c6du;
  h ^= h >> 12;
  h *= 0x297a2d39u;
  h ^= h >> 15;
  return static_cast<double>(h) / 2147483647.5 - 1;
}

// Fibers of the paper: noise, smooth between its cells.
double Paper(double x_mm, double y_mm, std::uint32_t seed) {
  const double u = x_mm / kFiber_mm, v = y_mm / kFiber_mm;
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(std::floor(v));
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double s = ease(u - i), t = ease(v - j);
  return (1 - t) * ((1 - s) * Noise(i, j, seed) + s * Noise(i + 1, j, seed)) +
         t * ((1 - s) * Noise(i, j + 1, seed) + s * Noise(i + 1, j + 1, seed));
}

// Radius of the spot that a point is blurred to, mm.
double Blur_mm(double distance_mm) {
  return kBlur_mm_per_mm * std::abs(distance_mm - kNominalDistance_mm);
}

// Mean of the paper over the spot around a point; a disc of equal samples stands for the spot.
double BlurredPaper(double x_mm, double y_mm, double blur_mm, std::uint32_t seed) {
  constexpr int kRings = 4;
  double sum = Paper(x_mm, y_mm, seed);
  int samples = 1;
  for (int ring = 1; ring <= kRings; ++ring) {
    for (int k = 0; k < 6 * ring; ++k) {
      const double angle = k * 3.14159265358979 / (3.0 * ring);
      const double radius = blur_mm * ring / kRings;
      sum += Paper(x_mm + radius * std::cos(angle), y_mm + radius * std::sin(angle), seed);
      ++samples;
    }
  }
  return sum / samples;
}

// Brightness that falls evenly from end to end; its mean is kept by the exposure.
double Slope(double ratio, int index) {
  const double from_middle = index / (kPictureSide - 1.0) - 0.5;
  return 1 + 2 * (ratio - 1) / (ratio + 1) * from_middle;
}

}  // namespace

double Magnification(const SurfaceOptics& optics, double distance_mm) {
  return 1 + optics.magnification_per_mm * (distance_mm - kNominalDistance_mm);
}

SurfacePicture RenderSurface(double x_mm, double y_mm, const SurfaceOptics& optics,
                             std::uint32_t seed) {
  const double pixel_mm = kView_mm / kPictureSide / Magnification(optics, optics.distance_mm);
  const double blur_mm = Blur_mm(optics.distance_mm);
  SurfacePicture picture{};
  for (int column = 0; column < kPictureSide; ++column) {
    for (int row = 0; row < kPictureSide; ++row) {
      const double px = x_mm + (column - (kPictureSide - 1) / 2.0) * pixel_mm;
      const double py = y_mm + (row - (kPictureSide - 1) / 2.0) * pixel_mm;
      double value = (kMean + kContrast * BlurredPaper(px, py, blur_mm, seed)) *
                     Slope(optics.lamp_shading, row) * Slope(optics.side_shading, column);
      // Dirt is near the lens, so out of focus: soft dark blots that stay where they are.
      if (optics.dirt > 0) {
        const double blot = 0.5 + 0.5 * Paper(column * 0.012, row * 0.012, 77u);
        if (blot < optics.dirt) value *= 0.35;
      }
      picture[static_cast<std::size_t>(column * kPictureSide + row)] =
          static_cast<std::uint8_t>(std::clamp(value, 0.0, 127.0));
    }
  }
  return picture;
}

std::uint8_t SurfaceQuality(const SurfaceOptics& optics) {
  const double focus = std::exp(-std::pow((optics.distance_mm - kNominalDistance_mm) / 0.3, 2));
  const double clean = 1 - std::clamp(optics.dirt, 0.0, 1.0);
  const double even = 1 / std::sqrt(std::max(optics.side_shading, 1 / optics.side_shading));
  return static_cast<std::uint8_t>(std::lround(64 * focus * clean * even));
}

}  // namespace torquer::emulator
