// Ray integrals through scans against closed forms, and the lumen carved out of a scan.
#include "host/simulator/effects/imaging/ct_body.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "host/simulator/effects/imaging/ct_carving.h"
#include "tests/support/ct_phantom.h"

using Eigen::Vector3d;
using torquer::effects::CArm;
using torquer::effects::CarveLumen;
using torquer::effects::CtAttenuation;
using torquer::effects::CtBody;
using torquer::effects::CtLumen;
using torquer::effects::CtVolume;
using torquer::effects::kBloodHu;
using torquer::effects::Plane;
using torquer::effects::Projection;
using torquer::test::ScanOf;
using torquer::test::ShareAt;

namespace {

constexpr double kWater60 = 0.02059;  // 1/mm at 60 keV, NIST 126

CArm ScanArm(int pixels) {
  CArm arm;
  arm.sid_mm = 1000;
  arm.sod_mm = 800;
  arm.detector_mm = 130;
  arm.width = arm.height = pixels;
  return arm;
}

CtBody BodyOf(CtVolume scan) { return {std::move(scan), CtAttenuation(60, 70), Vector3d::UnitZ()}; }

Plane FinePlane(const CtBody& body, const Projection& projection, int pixels) {
  Plane plane;
  plane.Clear(pixels, pixels);
  body.Refine(projection, 0, CtBody::FineParts(1000, plane), plane);
  return plane;
}

// Unit direction of the ray of a pixel.
Vector3d RayOf(const Projection& projection, int column, int row) {
  const Vector3d slope(projection.RightOf(column), projection.UpOf(row), 1);
  return (projection.camera().transpose() * slope).normalized();
}

// Chord of a ray in a body of water whose wall has moved outwards.
using ChordOf = std::function<double(const Vector3d& from, const Vector3d& ray, double moved_mm)>;

struct Differences {
  double relative = 0;  // root mean square, away from edges
  double beyond = 0;    // largest excess over the chords of walls moved by 1.5 voxels
  int away = 0;
};

Differences Compare(const CtBody& body, const Projection& projection, const ChordOf& chord) {
  constexpr int kPixels = 96;
  Plane plane = FinePlane(body, projection, kPixels);
  Differences found;
  for (int row = 0; row < kPixels; ++row) {
    for (int column = 0; column < kPixels; ++column) {
      const Vector3d& from = projection.source_mm();
      const Vector3d ray = RayOf(projection, column, row);
      const double got = static_cast<double>(plane.At(column, row)) / kWater60;
      const double least = chord(from, ray, -1.5);
      const double most = chord(from, ray, 1.5);
      found.beyond = std::max({found.beyond, least - got, got - most});
      if (!(chord(from, ray, -4) > 0)) continue;
      ++found.away;
      const double relative = got / chord(from, ray, 0) - 1;
      found.relative += relative * relative;
    }
  }
  found.relative = std::sqrt(found.relative / found.away);
  return found;
}

const Projection* Views() {
  static const Projection views[] = {{ScanArm(96), 0, 0},
                                     {ScanArm(96), 0.5, 0.3},
                                     {ScanArm(96), 1.5, -0.2},
                                     {ScanArm(96), 0.8, 0}};
  return views;
}

}  // namespace

TEST_CASE("Integrals through a sphere, a cylinder and a slab are their chords", "[effects]") {
  const Vector3d middle(1.3, -2.1, 0.7);
  const std::array<int, 3> size = {100, 100, 100};
  const Vector3d first(-49.5, -49.5, -49.5);
  constexpr double kRadius = 34;
  const auto in_sphere = [&](const Vector3d& at) { return kRadius - (at - middle).norm(); };
  const ChordOf sphere = [&](const Vector3d& from, const Vector3d& ray, double moved_mm) {
    const double miss = (middle - from - (middle - from).dot(ray) * ray).norm();
    const double r = kRadius + moved_mm;
    return miss < r ? 2 * std::sqrt(r * r - miss * miss) : 0.0;
  };
  // A cylinder along the patient's axis, which continues beyond the scan.
  const auto in_cylinder = [&](const Vector3d& at) {
    return kRadius - (at - middle).head<2>().norm();
  };
  const ChordOf cylinder = [&](const Vector3d& from, const Vector3d& ray, double moved_mm) {
    const Vector3d flat(ray[0], ray[1], 0);
    const Vector3d unit = flat.normalized();
    Vector3d across = middle - from;
    across[2] = 0;
    const double miss = (across - across.dot(unit) * unit).norm();
    const double r = kRadius + moved_mm;
    return miss < r ? 2 * std::sqrt(r * r - miss * miss) / flat.norm() : 0.0;
  };
  const auto water = [](double depth_mm) { return -1000 + 1000 * ShareAt(depth_mm, 1); };
  const CtBody ball =
      BodyOf(ScanOf(size, 1, first, [&](const Vector3d& at) { return water(in_sphere(at)); }));
  const CtBody rod =
      BodyOf(ScanOf(size, 1, first, [&](const Vector3d& at) { return water(in_cylinder(at)); }));
  for (int view = 0; view < 4; ++view) {
    INFO("view " << view);
    const Differences of_ball = Compare(ball, Views()[view], sphere);
    CHECK(of_ball.away > 1500);
    CHECK(of_ball.relative < 0.005);
    CHECK(of_ball.beyond < 0.05);
    const Differences of_rod = Compare(rod, Views()[view], cylinder);
    CHECK(of_rod.away > 1500);
    CHECK(of_rod.relative < 0.005);
    CHECK(of_rod.beyond < 0.05);
  }
  // Bone in front of fat, both flat, from the front and slanted.
  const CtAttenuation of(60, 70);
  const CtBody slabs = BodyOf(ScanOf(size, 1, first, [](const Vector3d& at) {
    return at[1] < -20 || at[1] > 30 ? -1000.0 : at[1] < -10 ? 1000.0 : -90.0;
  }));
  for (const double turned : {0.0, 0.35}) {
    const Projection projection(ScanArm(96), turned, 0);
    Plane plane = FinePlane(slabs, projection, 96);
    for (const int column : {40, 48, 56}) {
      for (const int row : {30, 48, 70}) {
        const double slant = std::abs(RayOf(projection, column, row)[1]);
        // The walls lie half-way between voxels.
        const double expected = (10 * of.Of(1000) + 40 * of.Of(-90) + 0.5 * of.Of(-90)) / slant;
        CHECK(plane.At(column, row) == Approx(expected).epsilon(0.01));
      }
    }
  }
}

TEST_CASE("A picture gets finer from the middle, and is then the fine one", "[effects]") {
  const CtBody body =
      BodyOf(ScanOf({60, 60, 60}, 1.5, Vector3d::Constant(-44), [](const Vector3d& at) {
        return -1000 + 1050 * ShareAt(30 - at.norm(), 1.5) + (std::abs(at[0] - 9) < 4 ? 700 : 0);
      }));
  const Projection projection(ScanArm(512), 0.3, 0.1);
  Plane plane;
  plane.Clear(512, 512);
  const float mean = body.FillCoarsely(projection, plane);
  const Plane coarse = plane;
  const Plane fine = FinePlane(body, projection, 512);
  double square = 0;
  double fine_mean = 0;
  for (std::size_t n = 0; n < fine.value.size(); ++n) {
    const double error = static_cast<double>(coarse.value[n] - fine.value[n]);
    square += error * error / static_cast<double>(fine.value.size());
  }
  for (int row = 128; row <= 384; ++row) {
    for (int column = 128; column <= 384; ++column) {
      fine_mean += static_cast<double>(fine.value[static_cast<std::size_t>(512 * row + column)]) /
                   (257.0 * 257);
    }
  }
  CHECK(std::sqrt(square) < 0.03);
  CHECK(static_cast<double>(mean) == Approx(fine_mean).epsilon(0.02));
  CHECK(CtBody::FineParts(0, plane) == 0);
  const int parts = CtBody::FineParts(5, plane);
  body.Refine(projection, 0, parts, plane);
  int same = 0;
  for (int row = 0; row < 512; ++row) {
    const std::size_t at = static_cast<std::size_t>(row) * 512;
    const bool is_fine = std::equal(&fine.value[at], &fine.value[at] + 512, &plane.value[at]);
    if (is_fine) ++same;
    if (std::abs(row - 256) < 4 * parts - 8) CHECK(is_fine);
  }
  CHECK(same >= 8 * parts);
  // After 45 pictures, in 3 s, all are fine.
  body.Refine(projection, parts, CtBody::FineParts(45, plane), plane);
  CHECK(plane.value == fine.value);
  // Rays that pass the middle of a part agree with the single middle ray of the dose.
  CHECK(body.MiddleIntegral(projection) ==
        Approx(static_cast<double>(plane.At(255, 255) + plane.At(256, 256)) / 2).epsilon(0.02));
}

namespace {

constexpr double kVoxel = 0.7;
constexpr double kBlur = 0.6;
constexpr double kAgent = 300;

// Blur of the scan with that of its voxels, whose box has this variance.
double WholeBlur() { return std::sqrt(kBlur * kBlur + kVoxel * kVoxel / 12); }

// Mean of f over a Gaussian of standard deviation `sigma`.
double Blurred(const std::function<double(double)>& f, double at, double sigma) {
  double sum = 0;
  double weight = 0;
  constexpr int kSteps = 200;
  for (int n = -kSteps; n <= kSteps; ++n) {
    const double x = 4 * sigma * n / kSteps;
    const double share = std::exp(-0.5 * x * x / (sigma * sigma));
    sum += share * f(at + x);
    weight += share;
  }
  return sum / weight;
}

double ChordAt(double x, double radius_mm) {
  return 2 * std::sqrt(std::max(0.0, radius_mm * radius_mm - x * x));
}

// Share of a long tube at a distance from its axis, after the blur of the scan.
std::vector<double> TubeProfile(double radius_mm) {
  const double sigma = WholeBlur();
  std::vector<double> profile;
  for (int n = 0; n < 200; ++n) {
    const auto within = [&](double x) {
      return std::erf(ChordAt(x, radius_mm) / 2 / (sigma * std::numbers::sqrt2));
    };
    profile.push_back(Blurred(within, 0.05 * n, sigma));
  }
  return profile;
}

struct Tube {
  double radius_mm;
  Vector3d axis;

  double Miss(const Vector3d& at) const { return (at - at.dot(axis) * axis).norm(); }
};

double Noise(std::uint32_t& state) {
  double sum = -6;
  for (int n = 0; n < 12; ++n) {
    state = 1664525U * state + 1013904223U;
    sum += state / 4294967296.0;
  }
  return 25 * sum;
}

}  // namespace

TEST_CASE("A carved vessel comes back by the blurred chords of its lumen", "[effects]") {
  const Tube tubes[] = {{4, Vector3d(0.2, 0.1, 1).normalized()},
                        {1.2, Vector3d(-0.3, 0.4, 1).normalized()}};
  for (const Tube& tube : tubes) {
    INFO("radius " << tube.radius_mm);
    const std::vector<double> profile = TubeProfile(tube.radius_mm);
    std::uint32_t state = 1;
    const auto share = [&](const Vector3d& at) {
      const double place = std::min(tube.Miss(at) / 0.05, 198.0);
      const auto n = static_cast<std::size_t>(place);
      return profile[n] + (place - static_cast<double>(n)) * (profile[n + 1] - profile[n]);
    };
    const CtVolume scan =
        ScanOf({70, 70, 60}, kVoxel, Vector3d(-24, -24, -20),
               [&](const Vector3d& at) { return kBloodHu + kAgent * share(at) + Noise(state); });
    CtVolume carved = scan;
    CtLumen lumen;
    lumen.clearance = [&](const Vector3d& at) { return tube.radius_mm - tube.Miss(at); };
    lumen.bounds_mm = {Vector3d::Constant(-60), Vector3d::Constant(60)};
    CarveLumen(lumen, kBlur, carved);
    // The removed part alone, as water of as many parts in a thousand.
    CtVolume removed = scan;
    for (std::size_t n = 0; n < scan.values.size(); ++n) {
      removed.values[n] = static_cast<std::int16_t>(scan.values[n] - carved.values[n] - 1000);
    }
    const CtBody body = BodyOf(std::move(removed));
    CArm arm = ScanArm(64);
    arm.detector_mm = 30;
    for (const double turned : {0.0, 1.2}) {
      const Projection projection(arm, turned, 0);
      Plane plane = FinePlane(body, projection, 64);
      std::vector<double> errors;
      for (int row = 0; row < 64; ++row) {
        for (int column = 0; column < 64; ++column) {
          const Vector3d ray = RayOf(projection, column, row);
          const Vector3d across = ray.cross(tube.axis);
          const double miss = projection.source_mm().dot(across.normalized());
          if (std::abs(miss) > tube.radius_mm + 2) continue;
          const double chord =
              Blurred([&](double x) { return ChordAt(x, tube.radius_mm); }, miss, WholeBlur());
          const double expected = kAgent / 1000 * kWater60 * chord / across.norm();
          errors.push_back(std::abs(static_cast<double>(plane.At(column, row)) - expected));
        }
      }
      REQUIRE(errors.size() > 500);
      std::sort(errors.begin(), errors.end());
      CHECK(errors[errors.size() * 95 / 100] < 0.002);
      CHECK(errors.back() < 0.004);
    }
  }
}

TEST_CASE("An agent that thins along the vessel leaves no trace", "[effects]") {
  const Tube tube{3, Vector3d::UnitZ()};
  const std::vector<double> profile = TubeProfile(tube.radius_mm);
  CtVolume scan = ScanOf({40, 40, 130}, kVoxel, Vector3d(-14, -14, -45), [&](const Vector3d& at) {
    const auto n = static_cast<std::size_t>(std::min(tube.Miss(at) / 0.05, 199.0));
    return kBloodHu + (300 - 2 * at[2]) * profile[n];
  });
  CtLumen lumen;
  lumen.clearance = [&](const Vector3d& at) { return tube.radius_mm - tube.Miss(at); };
  lumen.bounds_mm = {Vector3d(-3, -3, -60), Vector3d(3, 3, 60)};
  CarveLumen(lumen, kBlur, scan);
  double largest = 0;
  for (std::size_t n = 0; n < scan.values.size(); ++n) {
    const auto slice = n / (40 * 40);
    if (slice < 20 || slice > 110) continue;
    largest = std::max(largest, std::abs(scan.values[n] - kBloodHu));
  }
  CHECK(largest < 25);
}
