#include "tests/support/crossing_curves.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "host/simulator/core/newton/move_instruments.h"

namespace torquer::test {

const FreeSpace& NoVessel() {
  static const FreeSpace field;
  return field;
}

WireModel CoilWire(double ratio, double curvature, const Sheath& sheath, double segment_mm) {
  const double rigidity = 6e-3;
  return WireModel(segment_mm, {{0, rigidity, kWireMm, curvature, 0, ratio * rigidity}}, 0, 120,
                   BendingLaw::kExact, sheath);
}

namespace {

// Points of a coil around the z axis, from (radius, 0, 0) on.
std::vector<Vector3d> CoilPath(double radius_mm, double pitch_mm, double turns) {
  std::vector<Vector3d> path;
  for (double a = 0.02; a < 2 * M_PI * turns; a += 0.02) {
    path.emplace_back(radius_mm * std::cos(a), radius_mm * std::sin(a), pitch_mm * a / (2 * M_PI));
  }
  return path;
}

// Turns all segments a little, at random, and builds the model there.
void BuildNear(DenseCurves& curves, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> turn(-0.01, 0.01);
  Eigen::VectorXd x(curves.unknowns());
  for (double& component : x) component = turn(random);
  curves.state = curves.Stepped(x);
  curves.Build();
}

std::vector<WireModel> CoilWires(const Coil::Settings& s) {
  const Sheath sheath{Vector3d(3, 0, 0), Vector3d(0, 1, 0.02).normalized()};
  return std::vector<WireModel>(static_cast<std::size_t>(s.instruments),
                                CoilWire(s.ratio, s.curvature, sheath, s.segment_mm));
}

std::vector<WireModel> HeadOnWires(double ratio) {
  return {CoilWire(ratio, 0.02, {}, 1.3),
          CoilWire(ratio, 0, {.point_mm = {0, 3, 0}, .direction = {1, 0, 0}}, 1.3)};
}
// Straight on, and back on a circle of the radius `bow_mm` to the first wire.
std::vector<Vector3d> HeadOnWay() {
  constexpr double kBowMm = (3 - HeadOn::kApartMm) / 2;
  std::vector<Vector3d> way;
  for (double x = 0.1; x < 14; x += 0.1) way.emplace_back(x, 3, 0);
  for (double a = 0.05; a < M_PI; a += 0.05) {
    way.emplace_back(14 + kBowMm * std::sin(a), 3 - kBowMm + kBowMm * std::cos(a), 0);
  }
  for (double x = 14; x > 1; x -= 0.1) way.emplace_back(x, HeadOn::kApartMm, 0);
  return way;
}

std::vector<WireModel> TurnedBackWires(double ratio) {
  const double rigidity = 2e-2;
  return {CoilWire(ratio, 0.02, {}, 1.3),
          WireModel(1.3, {{0, rigidity, TurnedBack::kCatheterMm, 0, 0, ratio * rigidity}}, 0, 120,
                    BendingLaw::kExact, {})};
}
// Straight on to x = 12, then on circles: to (12, 2 r), and back along y = `apart_mm`.
std::vector<Vector3d> TurnedBackWay(double apart_mm, double end_mm) {
  constexpr double kBowMm = 3;
  constexpr double kStep = 0.05;
  const double slope = M_PI / 3;
  std::vector<Vector3d> way;
  Vector3d at = Vector3d::Zero();
  double heading = 0;
  const auto go = [&](double length_mm, double turn_rad) {
    const int steps = static_cast<int>(std::ceil(length_mm / kStep));
    for (int k = 0; k < steps; ++k) {
      heading += turn_rad / steps;
      way.push_back(at += length_mm / steps * Vector3d(std::cos(heading), std::sin(heading), 0));
    }
  };
  go(12, 0);
  go((M_PI + slope) * kBowMm, M_PI + slope);
  const double drop_mm = at[1] - apart_mm - kBowMm * (1 - std::cos(slope));
  go(drop_mm / std::sin(slope), 0);
  go(slope * kBowMm, -slope);
  go(at[0] - end_mm, 0);
  return way;
}

}  // namespace

Coil::Coil(const Settings& s, unsigned seed)
    : DenseCurves(CoilWires(s), {.touches_itself = true, .stiffness_N_mm2 = 2e-3}, NoVessel(),
                  {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
  const double length_mm = 2 * M_PI * 3 * s.turns - 1;
  InstrumentPoses poses(s.instruments);
  for (int k = 0; k < s.instruments; ++k) poses[k] = {length_mm - 3.7 * k, 0.3 * k};
  rods.Combine(poses);
  state = WireState::Along(model, CoilPath(3, 0.3, s.turns), poses);
  BuildNear(*this, seed);
}

HeadOn::HeadOn(double ratio, unsigned seed)
    : DenseCurves(HeadOnWires(ratio),
                  {.is_beside = {false, true},
                   .start_path_mm = {std::vector<Vector3d>(), HeadOnWay()},
                   .stiffness_N_mm2 = 2e-3},
                  NoVessel(), {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
  const InstrumentPoses poses{{13.1, 0}, {26.4, 0.2}};
  rods.Combine(poses);
  state = WireState::Along(model, {}, poses);
  LayCurves(rods, state);
  BuildNear(*this, seed);
}

TurnedBack::TurnedBack(double ratio, double apart_mm, unsigned seed, double catheter_mm)
    : DenseCurves(TurnedBackWires(ratio),
                  {.has_room = {false, true},
                   .lumen_radius_mm = {0, 0.4},
                   .touches_itself = true,
                   .stiffness_N_mm2 = 2e-3},
                  NoVessel(), {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
  const std::vector<Vector3d> way = TurnedBackWay(apart_mm, 2.2);
  double length_mm = way.front().norm();
  for (std::size_t k = 1; k < way.size(); ++k) length_mm += (way[k] - way[k - 1]).norm();
  const InstrumentPoses poses{{length_mm, 0}, {catheter_mm, 0.2}};
  rods.Combine(poses);
  state = WireState::Along(model, way, poses);
  LayCurves(rods, state);
  BuildNear(*this, seed);
}

const BetweenCurves& TurnedBack::Outside() const {
  return *std::find_if(at.between.begin(), at.between.end(), [](const BetweenCurves& between) {
    return !between.ordered && between.inner == 0 && between.outer == 1;
  });
}

}  // namespace torquer::test
