#include "host/simulator/effects/loads/gravity.h"

#include <catch2/catch.hpp>

#include "host/simulator/core/newton/newton_relaxation.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/wires.h"

namespace torquer::test {
namespace {

constexpr double kHangingLength = 50;
constexpr double kHangingRigidity = 2;

// A wire out of a sheath along x, bent by gravity along -y.
struct Hanging {
  WireModel model;
  FreeSpace field;
  WallModel wall;
  effects::Gravity gravity;
  std::vector<EnergyTerm*> terms{&gravity};
  NewtonRelaxation relaxation;
  WireState state;

  Hanging(double segment_mm, double rigidity, double weight_N_mm, int points = 2)
      : model(MakeWire({.segment_mm = segment_mm, .rigidity_N_mm2 = rigidity})),
        wall{.points_per_segment = points},
        gravity({Vector3d(0, -weight_N_mm, 0)}),
        relaxation(model, field, wall, {.tolerance = 1e-9}, terms),
        state(LayStraight(model, kHangingLength)) {
    relaxation.Restart(state);
    REQUIRE(Settle(relaxation, {kHangingLength, 0}, state).converged);
  }
};

TEST_CASE("A cantilever sinks by w L^4 / 8 EI under its own weight") {
  const int points = GENERATE(1, 2, 4);
  const double load = 0.01;  // w L^3 / EI
  const double weight = load * kHangingRigidity / std::pow(kHangingLength, 3);
  double error[2];
  int k = 0;
  for (const double segment_mm : {2.0, 1.0}) {
    const Hanging wire(segment_mm, kHangingRigidity, weight, points);
    error[k++] = wire.state.nodes().back()[1] / (-load / 8 * kHangingLength) - 1;
  }
  INFO("points " << points << " errors " << error[0] << " " << error[1]);
  CHECK(std::abs(error[1]) < 1e-3);
  CHECK(std::abs(error[1]) < 0.3 * std::abs(error[0]) + 1e-5);
}

// End of a heavy elastica of unit length: theta'' = load (1 - s) cos theta, theta(0) = 0, theta'(1)
// = 0. The angle counts downwards. Solved by shooting with Runge-Kutta steps.
Eigen::Vector2d HeavyElastica(double load) {
  const auto shoot = [load](double curvature, Eigen::Vector2d& end) {
    constexpr int kSteps = 4000;
    const double h = 1.0 / kSteps;
    double theta = 0;
    double slope = curvature;
    end.setZero();
    for (int k = 0; k < kSteps; ++k) {
      const double s = k * h;
      const auto pull = [&](double at, double angle) { return -load * (1 - at) * std::cos(angle); };
      const double k1 = pull(s, theta);
      const double m = theta + h / 2 * slope;
      const double k2 = pull(s + h / 2, m);
      const double k3 = pull(s + h / 2, m + h * h / 4 * k1);
      const double k4 = pull(s + h, theta + h * slope + h * h / 2 * k2);
      const double next = theta + h * slope + h * h / 6 * (k1 + k2 + k3);
      const double middle = (theta + next) / 2 - h * h / 8 * k2;
      end += h / 6 *
             (Eigen::Vector2d(std::cos(theta), std::sin(theta)) +
              4 * Eigen::Vector2d(std::cos(middle), std::sin(middle)) +
              Eigen::Vector2d(std::cos(next), std::sin(next)));
      slope += h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
      theta = next;
    }
    return slope;
  };
  Eigen::Vector2d end;
  double low = 0;
  double high = load;
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (shoot(middle, end) < 0 ? low : high) = middle;
  }
  return end;
}

TEST_CASE("A cantilever under a large own weight is the heavy elastica") {
  for (const double load : {2.0, 10.0}) {
    const Hanging wire(0.5, kHangingRigidity,
                       load * kHangingRigidity / std::pow(kHangingLength, 3));
    const Eigen::Vector2d end = HeavyElastica(load);
    INFO("load " << load << " end " << end.transpose());
    CHECK(wire.state.nodes().back()[0] ==
          Approx(end[0] * kHangingLength).margin(1e-3 * kHangingLength));
    CHECK(wire.state.nodes().back()[1] ==
          Approx(-end[1] * kHangingLength).margin(1e-3 * kHangingLength));
  }
}

TEST_CASE("Without stiffness the wire hangs straight down, drawn by its weight") {
  const double weight = 1e-3;
  const Hanging chain(0.5, 1e-3, weight);
  const double bend = std::cbrt(1e-3 / weight);  // length over which it turns downwards
  const Vector3d end = chain.state.nodes().back();
  CHECK(end[1] < -(kHangingLength - 2 * bend));
  // The tension at a place is the weight of everything below it.
  for (const int i : {20, 50, 80}) {
    const double below = kHangingLength - i * 0.5;
    const double tension =
        -chain.relaxation.Current().distal_gradient[static_cast<std::size_t>(i)].dot(
            chain.state.tangents()[static_cast<std::size_t>(i)]);
    CHECK(tension == Approx(weight * below).epsilon(0.02));
  }
}

}  // namespace
}  // namespace torquer::test
