#include "tests/support/two_curves.h"

#include <Eigen/Core>
#include <cmath>
#include <random>
#include <vector>

#include "host/simulator/core/newton/move_instruments.h"
#include "tests/support/twisted_stack.h"
#include "tests/support/wires.h"

namespace torquer::test {

namespace {

// Offset of the entry of an instrument that lies beside others, within a third one if that has
// room.
double OffsetMm(const TwoCurves::Marks& rooms) { return rooms[2] || rooms[3] ? 0.2 : 0.5; }
// `ratio` is GJ over EI; 0 means no twist. A third instrument lies on the catheter's curve.
std::vector<WireModel> Instruments(const Sheath& sheath, double ratio, int count,
                                   const TwoCurves::Marks& rooms, const TwoCurves::Marks& beside) {
  const auto entry = [&](std::size_t k) {
    Sheath own = sheath;
    if (beside[k]) own.point_mm[2] += OffsetMm(rooms);
    return own;
  };
  std::vector<WireModel> all;
  all.push_back(Bent(TwoCurves::kSoftest, ratio, 5.2, 0.1, 0, 0.2, sheath));
  all.push_back(Bent(2 * TwoCurves::kSoftest, ratio, 4.1, 0.02, -0.03, 0.5, entry(1)));
  const double third_mm = count > 3 ? 0.75 : 0.9;
  if (count > 2)
    all.push_back(Bent(3 * TwoCurves::kSoftest, ratio, 3.1, -0.01, 0.02, third_mm, entry(2)));
  if (count > 3)
    all.push_back(Bent(4 * TwoCurves::kSoftest, ratio, 2.1, 0.01, 0.02, 0.95, entry(3)));
  return all;
}
Clearance ClearanceOf(const TwoCurves::Marks& rooms, const TwoCurves::Marks& beside) {
  const bool wide = beside[1] || beside[2];
  return {.has_room = rooms,
          .lumen_radius_mm = wide ? std::array<double, kMostInstruments>{0, 0.28, 0.75, 1.3}
                                  : std::array<double, kMostInstruments>{0, 0.28, 0.6, 0.82},
          .is_beside = beside,
          .stiffness_N_mm2 = 2e-3};
}

}  // namespace

TwoCurves::TwoCurves(const InstrumentPoses& poses, int points_per_segment, unsigned seed,
                     double ratio, const Marks& rooms, const Marks& beside)
    : DenseCurves(Instruments(Entry(), ratio, poses.size(), rooms, beside),
                  ClearanceOf(rooms, beside), field,
                  {.stiffness_N_mm2 = 2e-3, .points_per_segment = points_per_segment}) {
  std::mt19937 random(seed);
  std::vector<Vector3d> arc;
  for (double a = 0.02; a < 1; a += 0.02) {
    arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
  }
  rods.Combine(poses);
  state = WireState::Along(model, arc, poses);
  LayCurves(rods, state);
  for (int c = 0; c < stack.curves(); ++c) {
    std::mt19937 alike(seed);  // all curves are shaken alike, so that they stay near each other
    Shake(rods[c], 0.03, alike, state.curve(c));
  }
  std::uniform_real_distribution<double> turn(-0.04, 0.04);
  Eigen::VectorXd x(unknowns());
  for (double& component : x) component = turn(random);
  // Spins accumulate from the sheath on, as twists of either sign.
  for (int c = 0; c < stack.curves(); ++c) {
    const int spins = rods[c].spins();
    for (int k = 0; k < spins; ++k) {
      double sum = 0;
      for (int i = 0; i < state.curve(c).segments(); ++i) {
        sum += 0.2 - 0.15 * k + 5 * turn(random);
        x[First(c) + (2 + spins) * i + 2 + k] = sum;
      }
    }
  }
  state = Stepped(x);
  Build();
}

}  // namespace torquer::test
