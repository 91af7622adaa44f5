// Section 3.2 of Baier et al. 2016: Geometrical Relaxation.
#include "host/simulator/core/paper/geometrical_relaxation.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <random>

#include "tests/support/analytic_fields.h"
#include "tests/support/finite_differences.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

// A wire whose segments have the given directions in the plane z = 0.
WireState LayAngles(const WireModel& model, const std::vector<double>& angles_rad) {
  const WireState straight =
      LayStraight(model, static_cast<double>(angles_rad.size()) * model.segment_mm());
  REQUIRE(straight.segments() == static_cast<int>(angles_rad.size()));
  std::vector<Vector3d> tangents;
  for (const double angle : angles_rad) tangents.emplace_back(std::cos(angle), std::sin(angle), 0);
  return WithTangents(model, straight, tangents);
}

// Bending energy between mu and nu, up to a factor: the terms of (22) that a cycle can change.
double TotalPsi(const std::vector<Vector3d>& x, int mu, int nu) {
  double sum = 0;
  for (int k = mu; k <= nu; ++k) {
    const double before = (x[k] - x[k - 1]).norm();
    const double after = (x[k + 1] - x[k]).norm();
    const double kappa = (x[k] - x[k - 1]).dot(x[k + 1] - x[k]) / (before * after);
    sum += (1 / before + 1 / after) * (13 - 14 * kappa + kappa * kappa) / 2;
  }
  return sum;
}

double DistanceTo(const std::vector<Vector3d>& line, const Vector3d& p) {
  double nearest = 1e300;
  for (std::size_t k = 0; k + 1 < line.size(); ++k) {
    const Vector3d d = line[k + 1] - line[k];
    const double t = std::clamp((p - line[k]).dot(d) / d.squaredNorm(), 0.0, 1.0);
    nearest = std::min(nearest, (p - line[k] - t * d).norm());
  }
  return nearest;
}

// Along a floor, over a wavy hump, and along the floor again: nodes 5 and 35 near the floor.
constexpr double kFloor = 0;
std::vector<double> Hump(double height_rad, double wave_rad) {
  std::vector<double> angles(46, 0.0);
  for (int i = 5; i < 35; ++i) {
    const double s = (i - 4.5) / 30;
    angles[i] = height_rad * std::sin(2 * M_PI * s) + wave_rad * std::sin(14 * M_PI * s);
  }
  return angles;
}

}  // namespace

TEST_CASE("Psi is g1 of three joints: (22)") {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> turn(-0.3, 0.3);
  std::vector<Vector3d> x{Vector3d::Zero()};
  std::vector<Vector3d> u;
  constexpr double kLength = 0.7;
  for (int k = 0; k < 4; ++k) {
    u.push_back(Vector3d(1, turn(random), turn(random)).normalized());
    x.emplace_back(x.back() + kLength * u.back());
  }
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    sum += EvaluateBending(BendingLaw::kG1, 1 - u[k].dot(u[k + 1])).g;
  }
  CHECK(GeometricalEnergy(x.data()) == Approx(12 / kLength * sum).epsilon(1e-12));
  // Unequal lengths: the formula as printed.
  x[2] += Vector3d(0.1, -0.2, 0.05);
  CHECK(GeometricalEnergy(x.data()) == Approx(TotalPsi(x, 1, 3)).epsilon(1e-12));
}

TEST_CASE("the gradient of Psi is that of finite differences: (23b)") {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> turn(-0.5, 0.5);
  for (int trial = 0; trial < 20; ++trial) {
    std::vector<Vector3d> x{Vector3d::Zero()};
    for (int k = 0; k < 4; ++k) {
      x.emplace_back(x.back() + Vector3d(0.8 + turn(random) / 2, turn(random), turn(random)));
    }
    const Eigen::VectorXd expected = GradientOf(
        [&](const Eigen::VectorXd& at) {
          std::vector<Vector3d> moved = x;
          moved[2] = at;
          return GeometricalEnergy(moved.data());
        },
        x[2], 1e-3);
    CHECK((GeometricalGradient(x.data()) - Vector3d(expected)).norm() < 1e-6 * expected.norm());
  }
}

TEST_CASE("the cubic spline has its ends and end tangents: (28), (29)") {
  const Vector3d a(1, 2, 3);
  const Vector3d b(9, 4, 2);
  const Vector3d at_a = Vector3d(1, 0.6, -0.2).normalized();
  const Vector3d at_b = Vector3d(1, -0.5, 0.3).normalized();
  const CubicSpline spline(a, at_a, b, at_b);
  REQUIRE(spline.valid());
  CHECK((spline.At(0) - a).norm() < 1e-14);
  CHECK((spline.At(1) - b).norm() < 1e-14);
  const double h = 1e-6;
  CHECK((spline.At(h) - a).normalized().dot(at_a) == Approx(1).epsilon(1e-10));
  CHECK((b - spline.At(1 - h)).normalized().dot(at_b) == Approx(1).epsilon(1e-10));
  // For a beam, the deflection across the chord is cubic, so its fourth difference vanishes.
  const auto at = [&](int k) { return spline.At(0.1 + 0.2 * k); };
  CHECK((at(0) - 4 * at(1) + 6 * at(2) - 4 * at(3) + at(4)).norm() < 1e-12);

  CHECK(CubicSpline({0, 0, 0}, {1, 0, 0}, {5, 0, 0}, {1, 0, 0}).alignment() == Approx(16));
  CHECK_FALSE(CubicSpline({0, 0, 0}, {0, 1, 0}, {5, 0, 0}, {1, 0, 0}).valid());
  CHECK_FALSE(CubicSpline({0, 0, 0}, {1, 0, 0}, {5, 0, 0}, {-1, 0, 0}).valid());
}

TEST_CASE("the interval with the largest merit is selected, its ends shrunk: (30), (31)") {
  const WireModel model = MakeWire({.max_length_mm = 80});
  // Two bumps on a straight line, the second one higher; the ends lie along the line.
  std::vector<double> angles(40, 0.0);
  angles[8] = 0.05;
  angles[9] = -0.05;
  angles[24] = 0.1;
  angles[25] = -0.1;
  const WireState state = LayAngles(model, angles);
  std::vector<char> near_wall(41, 0);
  for (const int i : {3, 15, 20, 33}) near_wall[i] = 1;
  const GeometricalSettings settings;

  auto interval = SelectInterval(model, state, near_wall, 39, settings);
  REQUIRE(interval);
  // Nodes up to 24 and from 26 on deviate from the (straight) spline only along it.
  const Vector3d x = state.nodes()[33] - state.nodes()[20];
  double sum = 0;
  std::vector<double> deviation(41, 0.0);
  for (int i = 20; i <= 33; ++i) {
    deviation[i] = (state.nodes()[i] - state.nodes()[20] - (i - 20) / 13.0 * x).norm();
    sum += deviation[i] * deviation[i];
  }
  const double sigma = std::sqrt(sum / 13);
  CHECK(interval->merit == Approx(16 * sigma));
  int mu = 20;
  while (deviation[mu + 1] < 0.1 * sigma) ++mu;
  int nu = 33;
  while (deviation[nu - 1] < 0.1 * sigma) --nu;
  CHECK(interval->mu == mu);
  CHECK(interval->nu == nu);
  CHECK(mu > 20);
  CHECK(nu < 33);

  SECTION("the tip is left out") {
    interval = SelectInterval(model, state, near_wall, 30, settings);
    REQUIRE(interval);
    CHECK(interval->mu < 15);
  }
  SECTION("an interval of few segments is left out") {
    near_wall[23] = near_wall[27] = 1;
    interval = SelectInterval(model, state, near_wall, 39, settings);
    REQUIRE(interval);
    CHECK(interval->nu <= 15);
  }
  SECTION("an interval of changing rigidity is left out") {
    const WireModel tapered(
        1, {{0, 1e-3, 0.178, 0, 0}, {12, 1e-3, 0.178, 0, 0}, {16, 6e-3, 0.178, 0, 0}}, 0, 80,
        BendingLaw::kExact, {});
    interval = SelectInterval(tapered, state, near_wall, 39, settings);
    REQUIRE(interval);
    CHECK(interval->nu <= 15);
  }
  SECTION("a straight wire has no step") {
    CHECK_FALSE(
        SelectInterval(model, LayStraight(model, 40), std::vector<char>(41, 0), 39, settings));
  }
}

TEST_CASE("point slide restores lengths to rounding: (24), (25)") {
  const bool second_order = GENERATE(false, true);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> turn(-0.4, 0.4);
  std::uniform_real_distribution<double> stretch(0.6, 1.7);
  std::vector<Vector3d> curve{Vector3d::Zero()};
  Vector3d u(1, 0, 0);
  for (int k = 0; k < 60; ++k) {
    u = (u + Vector3d(turn(random), turn(random), turn(random))).normalized();
    curve.emplace_back(curve.back() + stretch(random) * u);
  }
  std::vector<Vector3d> slid;
  SlidePoints(curve, 4, 1, second_order, slid);
  REQUIRE(slid.size() == curve.size());
  for (int j = 0; j <= 4; ++j) CHECK(slid[j] == curve[j]);
  double farthest = 0;
  for (std::size_t j = 5; j < slid.size(); ++j) {
    CHECK(std::abs((slid[j] - slid[j - 1]).norm() - 1) < 1e-12);
    farthest = std::max(farthest, DistanceTo(curve, slid[j]));
  }
  // Nodes are on the polyline, or within its sagittas.
  if (second_order) {
    CHECK(farthest < 0.3);
  } else {
    CHECK(farthest < 1e-12);
  }
}

TEST_CASE("point slide does not change a wire of equal lengths") {
  const WireModel model = MakeWire({.max_length_mm = 80});
  std::mt19937 random(6);
  const WireState state = Wander(model, 50, 0.1, random);
  std::vector<Vector3d> slid;
  SlidePoints(state.nodes(), 1, 1, true, slid);
  for (int j = 0; j <= 50; ++j) CHECK((slid[j] - state.nodes()[j]).norm() < 1e-12);
}

TEST_CASE("on a circle the second-order slide is better by two orders: (26), (27)") {
  constexpr double kRadius = 10;
  const auto error = [&](double lambda, bool second_order) {
    // Nodes on the circle, spaced slightly wider than required.
    std::vector<Vector3d> curve;
    const double angle = 2 * std::asin(1.07 * lambda / (2 * kRadius));
    for (int k = 0; k < 60; ++k) {
      curve.emplace_back(kRadius * std::cos(k * angle), kRadius * std::sin(k * angle), 0.0);
    }
    std::vector<Vector3d> slid;
    SlidePoints(curve, 1, lambda, second_order, slid);
    double largest = 0;
    for (int j = 2; j < 50; ++j) {
      largest = std::max(largest, std::abs(slid[j].norm() - kRadius));
    }
    return largest;
  };
  const double first = error(1, false);
  CHECK(first == Approx(1.07 * 1.07 / (8 * kRadius)).epsilon(0.1));
  CHECK(std::log2(first / error(0.5, false)) == Approx(2).margin(0.2));
  CHECK(error(1, true) < 0.01 * first);
  CHECK(std::log2(error(1, true) / error(0.5, true)) > 3.5);
}

TEST_CASE("an inflection takes no second-order correction") {
  // Zigzag: every segment lies between bends to opposite sides.
  std::vector<Vector3d> curve{Vector3d::Zero()};
  for (int k = 0; k < 20; ++k) {
    curve.emplace_back(curve.back() + 1.3 * Vector3d(1, k % 2 ? 0.3 : -0.3, 0).normalized());
  }
  std::vector<Vector3d> first;
  std::vector<Vector3d> second;
  SlidePoints(curve, 1, 1, false, first);
  SlidePoints(curve, 1, 1, true, second);
  for (std::size_t j = 0; j < curve.size(); ++j) CHECK((first[j] - second[j]).norm() < 1e-12);
}

TEST_CASE("a cycle lowers Psi and leaves the interval's ends and end tangents") {
  const WireModel model =
      MakeWire({.tip_mm = 4, .max_length_mm = 80, .sheath = {{0, 0.4, 0}, {1, 0, 0}}});
  WireState state = LayAngles(model, Hump(0.4, 0.2));
  const WireState before = state;
  const HalfSpace floor({0, kFloor, 0}, {0, 1, 0});
  GeometricalRelaxation relaxation(model, floor, {});
  REQUIRE(relaxation.Begin(state));
  const int mu = relaxation.interval().mu;
  const int nu = relaxation.interval().nu;
  CHECK(mu >= 5);
  CHECK(nu <= 36);
  CHECK(nu - mu > 20);

  double psi = TotalPsi(state.nodes(), mu, nu);
  const double psi_before = psi;
  for (int sweep = 1; sweep < nu - mu; ++sweep) {
    REQUIRE_FALSE(relaxation.Continue(1, state));
    const double now = TotalPsi(relaxation.curve(), mu, nu);
    CHECK(now <= psi * (1 + 1e-12));
    psi = now;
  }
  CHECK(HashState(state) == HashState(before));  // moved at the end only
  REQUIRE(relaxation.Continue(1, state));
  CHECK_FALSE(relaxation.active());
  CHECK(psi < 0.2 * psi_before);

  const std::vector<Vector3d>& curve = relaxation.curve();
  for (int i = 0; i <= 46; ++i) {
    if (i <= mu || i >= nu) CHECK(curve[i] == before.nodes()[i]);
  }
  for (int i = 0; i < mu; ++i) CHECK(state.tangents()[i] == before.tangents()[i]);
  CHECK(relaxation.zeta() > 0);
  for (int i = 0; i < 46; ++i) {
    CHECK(std::abs((state.nodes()[i + 1] - state.nodes()[i]).norm() - 1) < 1e-12);
    CHECK(std::abs(state.tangents()[i].dot(state.normals()[i])) < 1e-12);
  }
  // Beyond nu the wire slides along itself.
  CHECK(DistanceTo(state.nodes(), before.nodes()[nu]) < 0.05);
  CHECK((state.tangents()[44] - before.tangents()[44]).norm() < 1e-9);
  CHECK((state.nodes()[46] - before.nodes()[46]).norm() < 1);
}

TEST_CASE("a cycle takes out short waves and leaves long ones") {
  // nu - mu sweeps of single nodes: a fourth-order problem would need (nu - mu)^4 for the longest.
  const WireModel model = MakeWire({.max_length_mm = 80, .sheath = {{0, 0.4, 0}, {1, 0, 0}}});
  WireState state = LayAngles(model, Hump(0.4, 0.2));
  const WireState before = state;
  const HalfSpace floor({0, kFloor, 0}, {0, 1, 0});
  GeometricalRelaxation relaxation(model, floor, {});
  REQUIRE(relaxation.Begin(state));
  REQUIRE(relaxation.Continue(1000, state));
  // Components of both waves in the interval's directions, before and after.
  const auto part = [&](const std::vector<Vector3d>& x, double waves) {
    double sum = 0;
    for (int i = relaxation.interval().mu + 2; i < relaxation.interval().nu - 2; ++i) {
      const Vector3d d = x[i + 1] - x[i];
      sum += std::atan2(d[1], d[0]) * std::sin(2 * M_PI * waves * (i - 4.5) / 30);
    }
    return sum;
  };
  CHECK(std::abs(part(relaxation.curve(), 7)) < 0.1 * part(before.nodes(), 7));
  CHECK(part(relaxation.curve(), 1) > 0.7 * part(before.nodes(), 1));
}

TEST_CASE("zeta limits the motion of the tip to lambda") {
  const WireModel model = MakeWire({.max_length_mm = 80, .sheath = {{0, 0.4, 0}, {1, 0, 0}}});
  WireState state = LayAngles(model, Hump(0.9, 0.5));
  const WireState before = state;
  const HalfSpace floor({0, kFloor, 0}, {0, 1, 0});
  GeometricalRelaxation relaxation(model, floor, {});
  REQUIRE(relaxation.Begin(state));
  REQUIRE(relaxation.Continue(1000, state));
  CHECK(relaxation.zeta() > 0);
  CHECK(relaxation.zeta() < 1);
  const double gone = (state.nodes()[46] - before.nodes()[46]).norm();
  CHECK(gone < 1);
  CHECK(gone > 0.95);
}

TEST_CASE("zeta ends the new curve before the wall") {
  const WireModel model = MakeWire({.max_length_mm = 80, .sheath = {{0, 0.47, 0}, {1, 0, 0}}});
  // Towards the floor, then up and over it: the smooth curve would continue into the floor.
  std::vector<double> angles(32, 0.0);
  angles[4] = -0.28;
  for (int i = 5; i < 11; ++i) angles[i] = 0.2;
  for (int i = 21; i < 27; ++i) angles[i] = -0.2;
  angles[27] = 0.28;
  WireState state = LayAngles(model, angles);
  const WireState before = state;
  const HalfSpace floor({0, kFloor, 0}, {0, 1, 0});
  GeometricalSettings settings;
  settings.near_wall_mm = 0.1;
  GeometricalRelaxation relaxation(model, floor, settings);
  REQUIRE(relaxation.Begin(state));
  REQUIRE(relaxation.Continue(1000, state));
  const auto lowest = [&](double zeta) {
    double y = 1e300;
    for (int i = relaxation.interval().mu + 1; i < relaxation.interval().nu; ++i) {
      y = std::min(y, zeta * relaxation.curve()[i][1] + (1 - zeta) * before.nodes()[i][1]);
    }
    return y - model.radius_mm(0);
  };
  REQUIRE(lowest(1) < 0);
  CHECK(relaxation.zeta() > 0);
  CHECK(lowest(relaxation.zeta()) >= 0);
  CHECK(lowest(relaxation.zeta() + 0.002) < 0);
}

TEST_CASE("a cycle needs two contacts") {
  const WireModel model = MakeWire({.max_length_mm = 80});
  const WireState state = LayAngles(model, Hump(0.4, 0.2));
  const FreeSpace field;
  GeometricalRelaxation relaxation(model, field, {});
  CHECK_FALSE(relaxation.Begin(state));
  CHECK_FALSE(relaxation.active());
}

}  // namespace torquer::test
