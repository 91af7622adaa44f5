#include "host/simulator/vessel/brick_field.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/phantoms.h"
#include "host/support/error.h"
#include "tests/support/allocation_counter.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::AlignedBox3d;
using Eigen::Vector3d;

// Cylinder with round ends along a direction oblique to all grid axes, 9 mm to either side.
struct Cylinder {
  double radius_mm = 2;
  Vector3d direction = Vector3d(1, 0.37, 0.21).normalized();
  double operator()(const Vector3d& p) const {
    return radius_mm - (p - std::clamp(p.dot(direction), -9.0, 9.0) * direction).norm();
  }
};

AlignedBox3d Cube(double half_mm) {
  return {Vector3d::Constant(-half_mm), Vector3d::Constant(half_mm)};
}

BrickFieldOptions Voxel(double voxel_mm) {
  BrickFieldOptions options;
  options.voxel_mm = voxel_mm;
  return options;
}

double LargestCylinderError(double radius_mm, double voxel_mm) {
  const Cylinder cylinder{radius_mm};
  const auto field = BrickField::FromFunction(cylinder, Cube(12), Voxel(voxel_mm));
  Random random(11);
  double worst = 0;
  for (int i = 0; i < 100000; ++i) {
    const Vector3d p = random.InBox(Vector3d::Constant(-6), Vector3d::Constant(6));
    const double exact = cylinder(p);
    if (std::abs(exact) < 0.75) worst = std::max(worst, std::abs(field->Look(p) - exact));
  }
  return worst;
}

TEST_CASE("a cylinder's wall is met to micrometers") {
  CHECK(LargestCylinderError(2, 0.5) < 0.004);
  CHECK(LargestCylinderError(2, 0.25) < 0.0004);
  CHECK(LargestCylinderError(1, 0.25) < 0.012);
}

TEST_CASE("a brick field's derivatives agree with differences of its values") {
  const auto field = BrickField::FromFunction(Cylinder{}, Cube(30), Voxel(0.5));
  Random random(12);
  int checked = 0;
  for (int i = 0; i < 20000; ++i) {
    const double reach = i % 2 ? 6 : 60;
    const Vector3d p = random.InBox(Vector3d::Constant(-reach), Vector3d::Constant(reach));
    // The Hessian jumps between cells; within a cell it is the limit of the differences.
    ClearanceSample a, b;
    bool jumps = false;
    for (int axis = 0; axis < 3; ++axis) {
      field->LookHessian(p + 1e-5 * Vector3d::Unit(axis), a);
      field->LookHessian(p - 1e-5 * Vector3d::Unit(axis), b);
      jumps = jumps || (a.hessian - b.hessian).norm() > 1e-4;
    }
    if (jumps) continue;
    ++checked;
    const DerivativeErrors errors = CheckDerivatives(*field, p, 1e-5);
    CHECK(errors.gradient < 1e-8);
    CHECK(errors.hessian < 1e-6);
  }
  CHECK(checked > 15000);
}

TEST_CASE("value and gradient are continuous across cells, bricks, levels and the outer border") {
  BrickFieldOptions options = Voxel(0.5);
  options.margin_mm = 40;
  const auto field = BrickField::FromFunction(Cylinder{}, Cube(12), options);
  Random random(13);
  const auto jump = [&](const Vector3d& p, const Vector3d& step, double& value, double& gradient) {
    ClearanceSample a, b;
    field->LookGradient(p, a);
    field->LookGradient(p + step, b);
    value = std::max(value, std::abs(a.clearance_mm - b.clearance_mm));
    gradient = std::max(gradient, (a.gradient - b.gradient).norm());
  };
  double value = 0, gradient = 0;
  for (int i = 0; i < 50000; ++i) {
    // Lines through all bands: a step across a border is found by walking along them.
    const Vector3d p = random.InBox(Vector3d::Constant(-70), Vector3d::Constant(70));
    jump(p, 1e-7 * random.Direction(), value, gradient);
  }
  const Vector3d origin = Vector3d::Constant(-12 - options.margin_mm);
  for (int i = 0; i < 50000; ++i) {
    // Points exactly on borders of cells, and therefore also of bricks and levels.
    Vector3d p = random.InBox(Vector3d::Constant(-49), Vector3d::Constant(49));
    const int axis = i % 3;
    const double cell = i % 2 ? 0.5 * 8 : 2 * 8;
    p[axis] = origin[axis] + std::round((p[axis] - origin[axis]) / cell) * cell;
    jump(p - 1e-8 * Vector3d::Unit(axis), 2e-8 * Vector3d::Unit(axis), value, gradient);
  }
  CHECK(value < 5e-6);
  CHECK(gradient < 2e-5);
}

TEST_CASE("the slope of the field is within its bound") {
  const TubeVessel phantom = MakeTyPhantom();
  const auto field = BrickField::FromFunction(
      [&](const Vector3d& p) { return phantom.field->Clearance(p); }, phantom.bounds_mm, Voxel(1));
  Random random(14);
  double steepest = 0;
  for (int i = 0; i < 60000; ++i) {
    const Centerline& curve = phantom.centerlines.curves()[i % 3];
    const Vector3d p = curve.At(random.Uniform(0, curve.length_mm())).position_mm +
                       random.Uniform(0, i % 7 ? 8 : 80) * random.Direction();
    ClearanceSample sample;
    field->LookGradient(p, sample);
    steepest = std::max(steepest, sample.gradient.norm());
  }
  CHECK(steepest <= field->LipschitzBound());
  CHECK(steepest > 1);
}

TEST_CASE("a baked phantom follows the analytic one") {
  const TubeVessel phantom = MakeTyPhantom();
  const auto field = BrickField::FromFunction(
      [&](const Vector3d& p) { return phantom.field->Clearance(p); }, phantom.bounds_mm);
  Random random(15);
  double worst = 0, worst_gradient = 0;
  for (int i = 0; i < 10000; ++i) {
    // Stem, crossing and bend only, because every brick costs time.
    const Vector3d p = phantom.centerlines.curves()[0].At(random.Uniform(80, 150)).position_mm +
                       random.Uniform(2.5, 5) * random.Direction();
    ClearanceSample a, b;
    phantom.field->EvaluateGradient(p, a);
    if (std::abs(a.clearance_mm) > 1) continue;
    field->EvaluateGradient(p, b);
    worst = std::max(worst, std::abs(a.clearance_mm - b.clearance_mm));
    worst_gradient = std::max(worst_gradient, (a.gradient - b.gradient).norm());
  }
  CHECK(worst < 0.002);
  CHECK(worst_gradient < 0.02);
}

TEST_CASE("far outside the field is finite and leads back to the vessel") {
  const auto field =
      BrickField::FromFunction([](const Vector3d& p) { return 5 - p.norm(); }, Cube(5), Voxel(0.5));
  Random random(16);
  for (int i = 0; i < 2000; ++i) {
    const double r = std::pow(10, random.Uniform(1, 2.3));
    const Vector3d p = r * random.Direction();
    ClearanceSample sample;
    field->EvaluateHessian(p, sample);
    CHECK(sample.clearance_mm == Approx(5 - r).epsilon(0.02).margin(0.6));
    CHECK(sample.gradient.dot(-p.normalized()) > 0.8);
    CHECK(sample.hessian.allFinite());
  }
  for (const double r : {300.0, 1e4, 1e9, 1e200}) {
    const Vector3d outward = random.Direction(), p = r * outward;
    ClearanceSample sample;
    field->EvaluateHessian(p, sample);
    CHECK(std::isfinite(sample.clearance_mm));
    CHECK(sample.clearance_mm < -0.5 * r);
    CHECK(sample.gradient.allFinite());
    CHECK(sample.gradient.norm() < field->LipschitzBound());
    CHECK(sample.gradient.dot(-outward) > 0.5);
  }
  ClearanceSample sample;
  field->EvaluateGradient(Vector3d::Constant(std::nan("")), sample);
  CHECK(std::isnan(sample.clearance_mm));
}

uint64_t Fingerprint(const BrickField& field, bool backward) {
  Random random(17);
  std::vector<Vector3d> points;
  for (int i = 0; i < 3000; ++i) {
    points.push_back(random.InBox(Vector3d::Constant(-25), Vector3d::Constant(25)));
  }
  std::vector<double> values(points.size() * 4);
  for (size_t n = 0; n < points.size(); ++n) {
    const size_t i = backward ? points.size() - 1 - n : n;
    ClearanceSample sample;
    field.EvaluateGradient(points[i], sample);
    values[4 * i] = sample.clearance_mm;
    for (int a = 0; a < 3; ++a) values[4 * i + 1 + a] = sample.gradient[a];
  }
  uint64_t hash = 1;
  for (const double value : values) {
    uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    hash = (hash ^ bits) * 0x100000001b3;
  }
  return hash;
}

TEST_CASE("a value depends neither on the order of building nor on threads", "[threads]") {
  const auto make = [] { return BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5)); };
  const auto forward = make();
  const uint64_t expected = Fingerprint(*forward, false);
  CHECK(Fingerprint(*make(), true) == expected);
  const auto prefetched = make();
  prefetched->Prefetch({1, 2, 3}, 12);
  CHECK(Fingerprint(*prefetched, false) == expected);
  const auto complete = make();
  CHECK(complete->Build(0, 2));
  CHECK(Fingerprint(*complete, true) == expected);
  const auto shared = make();
  uint64_t seen[4];
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&, t] {
        if (t == 3) shared->Prefetch({0, 0, 0}, 10);
        seen[t] = Fingerprint(*shared, t % 2 == 1);
      });
    }
  }
  for (const uint64_t hash : seen) CHECK(hash == expected);
}

TEST_CASE("look-ups build only their region, and a repeated one neither builds nor allocates",
          "[threads]") {
  const auto field = BrickField::FromFunction(Cylinder{}, Cube(100), Voxel(0.25));
  CHECK(field->Statistics().bricks_built == 0);
  ClearanceSample sample;
  const std::vector<double> places = Steps(-9, 9, 0.1);
  const auto walk = [&] {
    double sum = 0;
    for (const double s : places) {
      field->EvaluateHessian(s * Cylinder{}.direction, sample);
      sum += sample.clearance_mm + field->Clearance(s * Cylinder{}.direction + Vector3d(0, 0, 3));
    }
    return sum;
  };
  const double first = walk();
  const BrickFieldStatistics statistics = field->Statistics();
  CHECK(statistics.bricks_built > 10);
  CHECK(statistics.bricks_built < 100);
  CHECK(statistics.brick_bytes < 100 * 4200);
  const size_t before = test::AllocationCount();
  CHECK(walk() == first);
  CHECK(test::AllocationCount() == before);
  CHECK(field->Statistics().bricks_built == statistics.bricks_built);
}

TEST_CASE("a look-up does not build prefetched parts", "[threads]") {
  const auto field = BrickField::FromFunction(Cylinder{}, Cube(100), Voxel(0.5));
  field->Prefetch({5, 5, 5}, 6);
  const size_t built = field->Statistics().bricks_built;
  CHECK(built > 0);
  Random random(18);
  for (int i = 0; i < 5000; ++i) {
    field->Clearance(Vector3d(5, 5, 5) + random.Uniform(0, 6) * random.Direction());
  }
  CHECK(field->Statistics().bricks_built == built);
}

TEST_CASE("a build can be stopped and taken up again", "[threads]") {
  const auto field = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
  std::stop_source stop;
  stop.request_stop();
  CHECK_FALSE(field->Build(0, 1, stop.get_token()));
  CHECK_FALSE(field->IsComplete(0));
  CHECK(field->Build(0, 1));
  CHECK(field->IsComplete(0));
  const size_t built = field->Statistics().bricks_built;
  CHECK(field->Build(0, 2));
  CHECK(field->Statistics().bricks_built == built);
}

// Bricks as in a cache file in memory: each with its checksum.
struct KeptBricks {
  static constexpr size_t kFloats = kernel::kCoefficients + 2;
  std::shared_ptr<std::vector<float>> memory;
  std::vector<StoredBrick> bricks;

  explicit KeptBricks(const BrickField& field) : bricks(field.StoredBricks()) {
    memory = std::make_shared<std::vector<float>>(kFloats * bricks.size());
    for (size_t i = 0; i < bricks.size(); ++i) {
      float* at = memory->data() + i * kFloats;
      std::memcpy(at, bricks[i].coefficients, kernel::kCoefficients * sizeof(float));
      const uint64_t checksum = bricks[i].Checksum();
      std::memcpy(at + kernel::kCoefficients, &checksum, sizeof checksum);
      bricks[i].coefficients = at;
    }
  }
};

TEST_CASE("stored bricks are taken over if they are whole, and built again if not") {
  const auto original = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
  CHECK(original->Build(0, 1));
  const uint64_t expected = Fingerprint(*original, false);
  const KeptBricks kept(*original);
  const auto& [memory, bricks] = kept;
  const std::vector<bool> complete(original->level_count(), true);
  const auto copy = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
  CHECK(copy->Adopt(bricks, complete, memory));
  CHECK(Fingerprint(*copy, false) == expected);
  CHECK(copy->Statistics().bricks_built == 0);
  CHECK(copy->StoredBricks().size() == bricks.size());

  for (size_t i = 0; i < bricks.size(); i += 3) {
    (*memory)[i * KeptBricks::kFloats + i % KeptBricks::kFloats] += 1;
  }
  const auto repaired = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
  CHECK(repaired->Adopt(bricks, complete, memory));
  CHECK(Fingerprint(*repaired, false) == expected);
  CHECK(repaired->Statistics().bricks_built > 0);
  CHECK(repaired->StoredBricks().size() == bricks.size());
}

TEST_CASE("a stored field that is falsely marked as complete makes no hole") {
  const auto original = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
  CHECK(original->Build(0, 1));
  const uint64_t expected = Fingerprint(*original, false);
  const KeptBricks whole(*original);
  const int top = original->level_count() - 1;
  const auto look = [&](const std::vector<StoredBrick>& kept, const std::vector<bool>& complete) {
    const auto field = BrickField::FromFunction(Cylinder{}, Cube(20), Voxel(0.5));
    field->Adopt(kept, complete, whole.memory);
    return Fingerprint(*field, false);
  };
  const std::vector<bool> all(static_cast<size_t>(top) + 1, true);
  CHECK(look({}, all) == expected);
  std::vector<bool> upside_down(all.size(), false);
  upside_down[0] = true;
  CHECK(look(whole.bricks, upside_down) == expected);
  for (int missing = 0; missing <= top; ++missing) {
    CAPTURE(missing);
    auto without_level = whole.bricks;
    std::erase_if(without_level, [&](const StoredBrick& brick) { return brick.level == missing; });
    const uint64_t seen = look(without_level, all);
    // Below the top level, a false "complete" may make the field coarser, and no more.
    if (missing == top) CHECK(seen == expected);
  }
  auto strange = whole.bricks;
  strange.front().level = -1;
  CHECK(look(strange, all) == expected);
  strange.front() = whole.bricks.front();
  strange.front().place[0] = INT32_MAX;
  CHECK(look(strange, all) == expected);
}

TEST_CASE("options out of range are refused with the remedy") {
  const auto make = [](const BrickFieldOptions& options, const AlignedBox3d& box) {
    return BrickField::FromFunction(Cylinder{}, box, options);
  };
  CHECK_THROWS_WITH(make(Voxel(0), Cube(5)), Contains("voxel_mm") && Contains("0.02 to 4"));
  CHECK_THROWS_AS(make(Voxel(std::nan("")), Cube(5)), UserError);
  CHECK_THROWS_WITH(make(Voxel(0.5), AlignedBox3d()), Contains("bounding box is empty"));
  CHECK_THROWS_WITH(make(Voxel(0.02), Cube(5000)), Contains("larger voxel_mm"));
  BrickFieldOptions tight = Voxel(0.5);
  tight.memory_limit_bytes = 1 << 18;
  const auto field = make(tight, Cube(20));
  CHECK_THROWS_WITH(field->Build(0, 2), Contains("larger voxel_mm"));
}

}  // namespace
}  // namespace torquer::vessel
