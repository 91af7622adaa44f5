#include "tests/support/twisted_stack.h"

#include <random>

namespace torquer::test {

template <class AnyCurve>
AnyCurve StackStep(const WireModel& model, const AnyCurve& from, const Eigen::VectorXd& x) {
  const int spins = model.spins();
  const Eigen::Index each = 2 + spins;
  std::vector<Frame> frames;
  std::vector<Vector2d> xi;
  std::vector<double> zeta;
  for (int i = 0; i < from.segments(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    frames.push_back(TangentFrame(from.tangents()[at], from.normals()[at]));
    xi.emplace_back(x.segment<2>(each * i));
    for (int k = 0; k < spins; ++k) zeta.push_back(x[each * i + 2 + k]);
  }
  AnyCurve to = from;
  to.Step(model, from, frames, xi, zeta, 1);
  return to;
}

template Curve StackStep(const WireModel&, const Curve&, const Eigen::VectorXd&);
template WireState StackStep(const WireModel&, const WireState&, const Eigen::VectorXd&);

WireModel Bent(double rigidity, double ratio, double curved_mm, double curvature_1,
               double curvature_2, double radius, const Sheath& sheath, double segment_mm) {
  const double gj = ratio * rigidity;
  return WireModel(segment_mm,
                   {{0, rigidity, radius, curvature_1, curvature_2, gj},
                    {curved_mm, 1.4 * rigidity, radius, curvature_1, curvature_2, 1.2 * gj},
                    {curved_mm + 1e-6, 1.4 * rigidity, radius, 0, 0, 1.2 * gj}},
                   0, 60, BendingLaw::kExact, sheath);
}

namespace {

std::vector<WireModel> TwistedInstruments(int count, const Sheath& sheath) {
  std::vector<WireModel> all;
  const double curvatures[4][2] = {{0.1, 0}, {0.03, 0.08}, {-0.05, 0.02}, {0.02, -0.02}};
  for (int k = 0; k < count; ++k) {
    all.push_back(Bent(TwistedStack::kSoftest * (1 + 0.5 * k), TwistedStack::kRatio, 5.2 + 2 * k,
                       curvatures[k][0], curvatures[k][1], 0.2 + 0.2 * k, sheath));
  }
  return all;
}

}  // namespace

TwistedStack::TwistedStack(int count, unsigned seed) : stack(TwistedInstruments(count, sheath)) {
  std::mt19937 random(seed);
  std::vector<Vector3d> arc;
  for (double a = 0.02; a < 1; a += 0.02) {
    arc.emplace_back(22 * std::cos(a), 22 * std::sin(a), 0.2);
  }
  const InstrumentPose all[4] = {{15.1, 0.4}, {11.3, -0.8}, {8.0, 2}, {3.9, 0}};
  InstrumentPoses poses(count);
  for (int k = 0; k < count; ++k) poses[k] = all[k];
  rods.Combine(poses);
  state = WireState::Along(model, arc, poses);
  Shake(model, 0.03, random, state);
  std::uniform_real_distribution<double> spin(-0.3, 0.3);
  Eigen::VectorXd x = Eigen::VectorXd::Zero(unknowns());
  PerInstrument sum = {};
  for (int i = 0; i < state.segments(); ++i) {
    for (int k = 0; k < count; ++k) {
      sum[static_cast<std::size_t>(k)] += 0.2 - 0.15 * k + spin(random);
      x[each * i + 2 + k] = sum[static_cast<std::size_t>(k)];
    }
  }
  state = StackStep(model, state, x);
  mechanics.BuildModel(state, at);
  roll.Begin(at.points);
  mechanics.BuildModel(state, at);
}

double TwistedStack::Energy(const Eigen::VectorXd& x) {
  mechanics.points().Forget();
  mechanics.BuildGradient(StackStep(model, state, x), trial);
  return trial.energy_mJ;
}

}  // namespace torquer::test
