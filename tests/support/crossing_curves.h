// Wires in contacts that cross: wound up, and head on. Models, and states that are no equilibria.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "host/simulator/core/newton/move_instruments.h"
#include "tests/support/analytic_fields.h"
#include "tests/support/dense_curves.h"

namespace torquer::test {

inline constexpr double kWireMm = 0.2;  // radius

inline const FreeSpace& NoVessel() {
  static const FreeSpace field;
  return field;
}

inline WireModel CoilWire(double ratio, double curvature, const Sheath& sheath, double segment_mm) {
  const double rigidity = 6e-3;
  return WireModel(segment_mm, {{0, rigidity, kWireMm, curvature, 0, ratio * rigidity}}, 0, 120,
                   BendingLaw::kExact, sheath);
}

// Points of a coil around the z axis, from (radius, 0, 0) on.
inline std::vector<Vector3d> CoilPath(double radius_mm, double pitch_mm, double turns) {
  std::vector<Vector3d> path;
  for (double a = 0.02; a < 2 * M_PI * turns; a += 0.02) {
    path.emplace_back(radius_mm * std::cos(a), radius_mm * std::sin(a), pitch_mm * a / (2 * M_PI));
  }
  return path;
}

// Instruments on one curve, wound up so that each turn presses on the next one.
struct Coil : DenseCurves {
  struct Settings {
    int instruments = 1;
    double ratio = 0;  // GJ over EI; 0 means no twist
    double curvature = 0;
    double segment_mm = 1.3;
    double turns = 1.5;
  };
  static std::vector<WireModel> Wires(const Settings& s) {
    const Sheath sheath{Vector3d(3, 0, 0), Vector3d(0, 1, 0.02).normalized()};
    return std::vector<WireModel>(static_cast<std::size_t>(s.instruments),
                                  CoilWire(s.ratio, s.curvature, sheath, s.segment_mm));
  }

  Coil(const Settings& s, unsigned seed)
      : DenseCurves(Wires(s), {.touches_itself = true, .stiffness_N_mm2 = 2e-3}, NoVessel(),
                    {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
    const double length_mm = 2 * M_PI * 3 * s.turns - 1;
    InstrumentPoses poses(s.instruments);
    for (int k = 0; k < s.instruments; ++k) poses[k] = {length_mm - 3.7 * k, 0.3 * k};
    rods.Combine(poses);
    mechanics.points().UpdateRadii();
    state = WireState::Along(model, CoilPath(3, 0.3, s.turns), poses);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> turn(-0.01, 0.01);
    Eigen::VectorXd x(unknowns());
    for (double& component : x) component = turn(random);
    state = Stepped(x);
    Build();
  }
};

// Two wires beside each other; the second one turns back, and faces the first one head on.
struct HeadOn : DenseCurves {
  static constexpr double kApartMm = 0.34;
  static std::vector<WireModel> Wires(double ratio) {
    return {CoilWire(ratio, 0.02, {}, 1.3),
            CoilWire(ratio, 0, {.point_mm = {0, 3, 0}, .direction = {1, 0, 0}}, 1.3)};
  }
  // Straight on, and back on a circle of the radius `bow_mm` to the first wire.
  static std::vector<Vector3d> Way() {
    constexpr double kBowMm = (3 - kApartMm) / 2;
    std::vector<Vector3d> way;
    for (double x = 0.1; x < 14; x += 0.1) way.emplace_back(x, 3, 0);
    for (double a = 0.05; a < M_PI; a += 0.05) {
      way.emplace_back(14 + kBowMm * std::sin(a), 3 - kBowMm + kBowMm * std::cos(a), 0);
    }
    for (double x = 14; x > 1; x -= 0.1) way.emplace_back(x, kApartMm, 0);
    return way;
  }

  HeadOn(double ratio, unsigned seed)
      : DenseCurves(Wires(ratio),
                    {.is_beside = {false, true},
                     .start_path_mm = {std::vector<Vector3d>(), Way()},
                     .stiffness_N_mm2 = 2e-3},
                    NoVessel(), {.stiffness_N_mm2 = 2e-3, .points_per_segment = 2}) {
    const InstrumentPoses poses{{13.1, 0}, {26.4, 0.2}};
    rods.Combine(poses);
    state = WireState::Along(model, {}, poses);
    LayCurves(rods, state);
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> turn(-0.01, 0.01);
    Eigen::VectorXd x(unknowns());
    for (double& component : x) component = turn(random);
    for (int c = 0; c < 2; ++c) mechanics.points(c).UpdateRadii();
    state = Stepped(x);
    Build();
  }
};

}  // namespace torquer::test
