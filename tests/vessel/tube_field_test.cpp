#include "host/simulator/vessel/tube_field.h"

#include <limits>

#include "catch2/catch.hpp"
#include "host/simulator/vessel/phantoms.h"
#include "host/support/error.h"
#include "tests/support/sanitizer.h"
#include "tests/vessel/field_checks.h"

namespace torquer::vessel {
namespace {

using Catch::Contains;
using Eigen::Vector3d;

Tube TaperedBend() {
  ArcLinePath axis =
      ArcLinePath::FromCorners({{0, 0, 0}, {40, 0, 0}, {60, 30, 10}, {60, 60, 40}}, 15);
  const double length = axis.length_mm();
  return {"tapered", axis, {5, 3.5, 2.5, 3}, {0, length * 0.3, length * 0.7, length}};
}

TEST_CASE("a straight tube's clearance is radius less distance from its axis") {
  const TubeVessel vessel = MakeStraightTube(100, 3);
  Random random(1);
  for (int i = 0; i < 1000; ++i) {
    const Vector3d p = random.InBox({0, -10, -10}, {100, 10, 10});
    const double d = std::hypot(p.y(), p.z());
    if (d < 1.5) continue;
    CHECK(vessel.field->Clearance(p) == Approx(3 - d).margin(1e-12));
  }
  CHECK(vessel.field->Clearance({-5, 0, 0}) == Approx(-2));  // half sphere at the end
  CHECK(vessel.field->Clearance({103.5, 0, 0}) == Approx(-0.5));
}

TEST_CASE("a torus' clearance is that of a torus, all the way round") {
  const TubeVessel vessel = MakeTorus(50, 4, 2 * M_PI);
  Random random(2);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p = random.InBox({-60, -10, -8}, {60, 110, 8});
    const double ring = std::hypot(p.x(), p.y() - 50);
    const double d = std::hypot(ring - 50, p.z());
    if (d < 2) continue;
    CHECK(vessel.field->Clearance(p) == Approx(4 - d).margin(1e-12));
  }
}

TEST_CASE("tube fields' derivatives agree with differences of their values") {
  const TubeVessel phantom = MakeTyPhantom();
  const TubeField tapered({TaperedBend()}, 0);
  Random random(3);
  int checked = 0;
  const auto check = [&](const ClearanceField& field, const Centerline& curve, double reach) {
    for (int i = 0; i < 4000; ++i) {
      const Vector3d p = curve.At(random.Uniform(0, curve.length_mm())).position_mm +
                         random.Uniform(0, reach) * random.Direction();
      // A Hessian that jumps within the difference's step cannot agree with it.
      ClearanceSample a, b;
      bool jumps = false;
      for (int axis = 0; axis < 3; ++axis) {
        field.EvaluateHessian(p + 2e-5 * Vector3d::Unit(axis), a);
        field.EvaluateHessian(p - 2e-5 * Vector3d::Unit(axis), b);
        jumps = jumps || (a.hessian - b.hessian).norm() > 2e-4;
      }
      if (jumps) continue;
      ++checked;
      const DerivativeErrors errors = CheckDerivatives(field, p, 1e-5);
      CHECK(errors.gradient < 5e-9);
      CHECK(errors.hessian < 1e-7);
    }
  };
  for (const Centerline& curve : phantom.centerlines.curves()) check(*phantom.field, curve, 5);
  check(tapered, CenterlineOf(TaperedBend()), 5);
  CHECK(checked > 15000);
}

TEST_CASE("tubes longer than those of any vessel are refused") {
  const auto make = [](double length_mm) {
    const ArcLinePath axis = ArcLinePath::FromCorners({{0, 0, 0}, {length_mm, 0, 0}}, 15);
    return MakeTubeVessel({{"a", axis, {2}, {}}, {"b", axis, {2}, {}}}, 1, 1);
  };
  CHECK(make(20'000).centerlines.curves().size() == 2);
  CHECK_THROWS_WITH(make(26'000), Contains("52000") && Contains("50000") && Contains("unit"));
}

TEST_CASE("between two points the radius changes as documented for radii_mm") {
  const double length = 1000;
  const TubeField taper(
      {{"taper", ArcLinePath::FromCorners({{0, 0, 0}, {length, 0, 0}}, 15), {3, 2}, {0, length}}},
      0);
  // The values of t^2 (3 - 2 t) at t = 1/4, 1/2, 3/4 are 10/64, 1/2, 54/64. The wall's slope is at
  // most 1.5/1000. So the distance to it differs from the radius by at most 3 mm (1.5e-3)^2 / 2.
  const double shares[] = {10.0 / 64, 0.5, 54.0 / 64};
  for (int k = 0; k < 3; ++k) {
    const double radius = 3 - shares[k];
    const Vector3d near_wall(0.25 * (k + 1) * length, radius - 0.01, 0);
    CHECK(taper.Clearance(near_wall) == Approx(0.01).margin(3.4e-6));
  }
}

TEST_CASE("a tapered tube is the envelope of its spheres") {
  const Tube tube = TaperedBend();
  const TubeField field({tube}, 0);
  const Centerline curve = CenterlineOf(tube, 0.05);
  std::vector<CenterlineSample> spheres;
  for (const double s : Steps(0, curve.length_mm(), 0.02)) spheres.push_back(curve.At(s));
  Random random(4);
  for (int i = 0; i < test::Rounds(300, 5); ++i) {
    const CenterlineSample at = curve.At(random.Uniform(0, curve.length_mm()));
    const Vector3d p = at.position_mm + random.Uniform(1.5, 5) * random.Direction();
    double best = -std::numeric_limits<double>::infinity();
    double nearest = std::numeric_limits<double>::infinity();
    for (const CenterlineSample& sphere : spheres) {
      const double d = (p - sphere.position_mm).norm();
      best = std::max(best, sphere.radius_mm - d);
      nearest = std::min(nearest, d);
    }
    if (nearest < 1.3) continue;
    CHECK(field.Clearance(p) == Approx(best).margin(2e-4));
  }
}

TEST_CASE("the union of tubes is smooth where they meet and no steeper than a distance") {
  const TubeVessel phantom = MakeTyPhantom();
  Random random(5);
  double largest_jump = 0, steepest = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d p = Vector3d(100, 0, 0) + random.InBox({-8, -8, -8}, {8, 8, 8});
    const Vector3d q = p + 1e-6 * random.Direction();
    ClearanceSample a, b;
    phantom.field->EvaluateGradient(p, a);
    phantom.field->EvaluateGradient(q, b);
    steepest = std::max(steepest, a.gradient.norm());
    if (a.clearance_mm > -2)
      largest_jump = std::max(largest_jump, (a.gradient - b.gradient).norm());
  }
  CHECK(steepest <= phantom.field->LipschitzBound());
  CHECK(largest_jump < 5e-6);
}

TEST_CASE("a grid of samples has the bits of single samples") {
  // Tapered and thin tubes that cross, touch, run beside each other and lie far apart.
  Random random(29);
  const auto tube = [&](const std::string& name) {
    const Vector3d from = random.InBox(Vector3d::Constant(-25), Vector3d::Constant(25));
    const Vector3d over = random.InBox(Vector3d::Constant(-25), Vector3d::Constant(25));
    const Vector3d to = random.InBox(Vector3d::Constant(-60), Vector3d::Constant(60));
    const ArcLinePath axis = ArcLinePath::FromCorners({from, over, to}, 30);
    const double radius = std::min(random.Uniform(0.4, 4), 0.9 * axis.SmallestBendRadius());
    return Tube{name, axis, {radius, radius, 0.8 * radius}, axis.corner_arc_lengths_mm()};
  };
  for (const double width_mm : {0.0, 1.0, 5.0}) {
    std::vector<Tube> tubes{TaperedBend()};
    for (int k = 0; k < 6; ++k) tubes.push_back(tube("tube " + std::to_string(k)));
    const TubeField field(tubes, width_mm);
    for (int grid = 0; grid < (torquer::test::kUnderSanitizer ? 20 : 200); ++grid) {
      constexpr int kCount = 5;
      const double step_mm = std::exp(random.Uniform(std::log(0.05), std::log(20.0)));
      const Vector3d low = random.InBox(Vector3d::Constant(-50), Vector3d::Constant(50));
      double axis[3][kCount];
      for (int a = 0; a < 3; ++a) {
        for (int i = 0; i < kCount; ++i) axis[a][i] = low[a] + i * step_mm;
      }
      double samples[kCount * kCount * kCount];
      field.SampleGrid(axis[0], axis[1], axis[2], kCount, std::numeric_limits<double>::infinity(),
                       samples);
      int differ = 0;
      for (int at = 0; at < kCount * kCount * kCount; ++at) {
        const Vector3d p(axis[0][at % kCount], axis[1][at / kCount % kCount],
                         axis[2][at / (kCount * kCount)]);
        differ += samples[at] != field.Clearance(p);
      }
      INFO("union width " << width_mm << " mm, grid " << grid << ", step " << step_mm << " mm");
      CHECK(differ == 0);
    }
  }
}

TEST_CASE("the phantom's main path is open all along and about 280 mm long") {
  const TubeVessel phantom = MakeTyPhantom();
  const Centerline& main = phantom.centerlines.curves()[0];
  CHECK(main.length_mm() > 275);
  CHECK(main.length_mm() < 290);
  CHECK(phantom.entry_point_mm().norm() < 1e-12);
  CHECK((phantom.entry_direction() - Vector3d::UnitX()).norm() < 1e-12);
  for (const Centerline& curve : phantom.centerlines.curves()) {
    for (const double s : Steps(0, curve.length_mm(), 0.25)) {
      const CenterlineSample at = curve.At(s);
      const double clearance = phantom.field->Clearance(at.position_mm);
      CHECK(clearance > 2);
      CHECK(clearance < 5);
      CHECK(phantom.bounds_mm.contains(at.position_mm));
    }
  }
  CHECK(phantom.centerlines.joints().size() == 2);
  const Centerline other = phantom.centerlines.Path(phantom.centerlines.Place("main", "start"),
                                                    phantom.centerlines.Place("child", "end"));
  CHECK(other.length_mm() == Approx(main.length_mm()).margin(0.01));
}

TEST_CASE("the phantom's wall is nowhere dented or bulged by more than its rounding") {
  const TubeVessel phantom = MakeTyPhantom();
  Random random(6);
  for (int i = 0; i < 5000; ++i) {
    // Opposite the crossing, where the stem must have no effect.
    const Vector3d at =
        Vector3d(100, 0, 0) + random.Uniform(-6, 6) * Vector3d(std::cos(1.309), std::sin(1.309), 0);
    const Vector3d wall = at + 4 * Vector3d(std::sin(1.309), -std::cos(1.309), 0);
    CHECK(std::abs(phantom.field->Clearance(wall)) < 0.02);
  }
}

TEST_CASE("a tube that cannot be is refused with its name, the value and the remedy") {
  ArcLinePath axis(Vector3d::Zero(), Vector3d::UnitX());
  axis.Line(20).Arc(5, 1, Vector3d::UnitY());
  CHECK_THROWS_WITH(TubeField({{"a", axis, {-1}, {}}}, 0), Contains("\"a\"") && Contains("-1.0"));
  CHECK_THROWS_WITH(TubeField({{"a", axis, {std::nan("")}, {}}}, 0), Contains("above 0"));
  CHECK_THROWS_WITH(TubeField({{"a", axis, {5}, {}}}, 0), Contains("95 % of the bend radius"));
  CHECK_THROWS_WITH(TubeField({{"a", axis, {2, 3}, {0}}}, 0), Contains("one for each"));
  CHECK_THROWS_WITH(TubeField({{"a", axis, {1, 4}, {0, 5}}}, 0), Contains("a quarter"));
  CHECK_THROWS_AS(TubeField({}, 0), UserError);
  CHECK_THROWS_WITH(ArcLinePath::FromCorners({{0, 0, 0}}, 1), Contains("two corners"));
  CHECK_THROWS_WITH(ArcLinePath::FromCorners({{0, 0, 0}, {0, 0, 0}}, 1), Contains("same point"));
  CHECK_THROWS_WITH(ArcLinePath::FromCorners({{0, 0, 0}, {9, 0, 0}, {1, 0, 0}}, 1),
                    Contains("turns back"));
}

TEST_CASE("a path of rounded corners is continuous, and its bends are as round as they may be") {
  const ArcLinePath path =
      ArcLinePath::FromCorners({{0, 0, 0}, {30, 0, 0}, {30, 20, 0}, {30, 20, 4}, {60, 20, 4}},
                               std::numeric_limits<double>::infinity());
  Vector3d before = path.PointAt(0), tangent = path.TangentAt(0);
  const double step = path.length_mm() / 10000;
  for (int i = 1; i <= 10000; ++i) {
    const Vector3d here = path.PointAt(i * step);
    CHECK((here - before).norm() == Approx(step).epsilon(1e-4));
    CHECK((path.TangentAt(i * step) - tangent).norm() < step / path.SmallestBendRadius() * 1.01);
    before = here;
    tangent = path.TangentAt(i * step);
  }
  CHECK((before - Vector3d(60, 20, 4)).norm() < 1e-9);
  CHECK(path.SmallestBendRadius() == Approx(2));
  CHECK(path.corner_arc_lengths_mm().size() == 5);
}

}  // namespace
}  // namespace torquer::vessel
