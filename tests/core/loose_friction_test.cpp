// Friction on the wall of instruments on two curves.
#include <catch2/catch.hpp>

#include "host/simulator/effects/contact/friction.h"
#include "tests/support/finite_differences.h"
#include "tests/support/two_curves.h"

namespace torquer::test {
namespace {

TEST_CASE("Friction of two curves on the wall has the gradient of finite differences") {
  const InstrumentPoses poses = GENERATE(kWireLeads, kCatheterLeads);
  const int points_per_segment = GENERATE(1, 2, 3);
  TwoCurves curves(poses, points_per_segment, 3);
  effects::EffectContext context{curves.model, curves.wall};
  context.instruments.resize(2);
  context.stack = &curves.stack;
  effects::Friction friction(0.5, 0.05, context);
  curves.terms.push_back(&friction);
  curves.at = curves.mechanics.MakeQuadraticModel();
  const auto expand = [&] {
    curves.Forget();
    curves.mechanics.BuildModel(curves.state, curves.at);
  };
  // Sets the anchors at rest, then moves the curves by less than the slip length.
  expand();
  for (int c = 0; c < 2; ++c) {
    const PointSet& points = curves.at.curve(c).points;
    friction.Begin(points);
    friction.End(points);
    friction.Begin(points);
  }
  Eigen::VectorXd x = Eigen::VectorXd::Constant(curves.unknowns(), 8e-4);
  for (Eigen::Index k = 0; k < x.size(); k += 3) x[k] = -5e-4;
  curves.state = curves.Stepped(x);
  expand();
  const Eigen::VectorXd with = curves.Gradient();
  const Eigen::VectorXd gradient =
      GradientOf([&](const Eigen::VectorXd& step) { return curves.Energy(step); },
                 Eigen::VectorXd::Zero(curves.unknowns()), 1e-4);
  CHECK((gradient - with).norm() < 1e-6 * gradient.norm());
  // Friction must contribute a substantial part of the gradient.
  friction.Reset();
  expand();
  CHECK((curves.Gradient() - with).norm() > 1e-3 * with.norm());
}

}  // namespace
}  // namespace torquer::test
