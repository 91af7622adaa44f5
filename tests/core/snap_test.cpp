// Snaps that a tick reports.
#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "host/simulator/core/relaxation.h"
#include "tests/support/two_curves.h"

namespace torquer::test {
namespace {

// Relaxation that moves the tip of one curve aside in its only attempt.
class TipAside final : public Relaxation {
 public:
  TipAside(const InstrumentStack& stack, int curve, double aside_mm)
      : Relaxation(stack), curve_(curve), aside_mm_(aside_mm) {}
  void Restart(WireState&) override {}
  void CopyFrom(const Relaxation&, const WireState&) override {}
  const QuadraticModel& Current() const override { return current_; }
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }
  double SolverErrorMm(const WireState&) override { return 0; }
  double DiscretizationErrorMm(const WireState&) override { return 0; }

 private:
  bool Arrived(const InstrumentPoses&, const WireState&) const override { return true; }
  void Begin(WireState&) override {}
  bool MayMove() const override { return false; }
  int Move(const InstrumentPoses&, WireState&) override { return 0; }
  bool AtRest(WireState&) override { return done_; }
  void Relax(WireState& state, TickReport&) override {
    done_ = true;
    Curve& curve = state.curve(curve_);
    const Vector3d& tangent = curve.tangents().back();
    const double length_mm = stack().empty_rod(curve_).segment_mm();
    const double angle_rad = 2 * std::asin(aside_mm_ / length_mm / 2);
    const Eigen::AngleAxisd turn(angle_rad, curve.normals().back());
    curve.TurnDistal(stack().empty_rod(curve_), {turn * tangent});
  }
  void End(const WireState&, bool, TickReport&) override {}

  int curve_;
  double aside_mm_;
  bool done_ = false;
  QuadraticModel current_;
};

TEST_CASE("A snap of any curve is reported") {
  const int curve = GENERATE(0, 1);
  const double aside_mm = GENERATE(0.3, 0.7);
  TwoCurves curves({{16, 0}, {9, 0}}, 2, 11);
  REQUIRE(curves.state.curves() == 2);
  TipAside relaxation(curves.stack, curve, aside_mm);
  CountedBudget budget(10);
  const TickReport report = relaxation.Tick(curves.state.poses(), budget, curves.state);
  CHECK(report.work == 1);
  CHECK(report.snapped == (aside_mm > 0.5));
}

}  // namespace
}  // namespace torquer::test
