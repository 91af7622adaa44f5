// Friction where instruments lie within each other and twist.
#include <catch2/catch.hpp>

#include "host/simulator/effects/contact/friction.h"
#include "tests/support/twisted_stack.h"

namespace torquer::test {
namespace {

TEST_CASE("A surface that comes to a point of another's has not rolled there") {
  TwistedStack stack(2, 11);
  effects::EffectContext context{stack.model, stack.wall};
  context.instruments.resize(2);
  effects::Friction friction(0.3, 0.01, context);
  PointSet points = stack.at.points;
  friction.Begin(points);
  friction.End(points);
  friction.Begin(points);
  PointDerivatives out;
  const auto energy_mJ = [&] {
    out.used.assign(points.position.size(), PointDerivatives::kNothing);
    out.gradient.resize(points.position.size());
    return friction.Add(points, out);
  };
  REQUIRE(energy_mJ() < 1e-12);
  // The outer one is drawn back beyond all points: elsewhere it would have turned the surface.
  points.behind_mm[1] = 1e3;
  CHECK(energy_mJ() < 1e-12);
  points.behind_mm[1] = stack.at.points.behind_mm[1];
  for (auto& turns : points.turns_rad) turns[1] += 0.1;
  CHECK(energy_mJ() > 1e-6);
}

}  // namespace
}  // namespace torquer::test
