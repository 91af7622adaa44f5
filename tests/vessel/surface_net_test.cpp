#include "host/simulator/vessel/surface_net.h"

#include <catch2/catch.hpp>
#include <numbers>

using namespace torquer;
using namespace torquer::vessel;

namespace {

class Ball final : public ClearanceField {
 public:
  double Clearance(const Eigen::Vector3d& point_mm) const override {
    return kRadiusMm - (point_mm - kCenterMm).norm();
  }
  void EvaluateGradient(const Eigen::Vector3d&, ClearanceSample&) const override {}
  void EvaluateHessian(const Eigen::Vector3d&, ClearanceSample&) const override {}
  double LipschitzBound() const override { return 1; }

  static constexpr double kRadiusMm = 7;
  inline static const Eigen::Vector3d kCenterMm{1, 2, 3};
};

}  // namespace

TEST_CASE("The surface net of a ball is a closed sphere, wound outward") {
  const Ball ball;
  const double reach = GENERATE(7.0, 9.3, 40.0);
  const Eigen::AlignedBox3d bounds(Ball::kCenterMm - Eigen::Vector3d::Constant(reach),
                                   Ball::kCenterMm + Eigen::Vector3d::Constant(reach));
  const TriangleMesh surface = SurfaceOf(ball, bounds, 0.5);
  double volume = 0;
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const Eigen::Vector3d& a = surface.Corner(i, 0);
    const Eigen::Vector3d& b = surface.Corner(i, 1);
    const Eigen::Vector3d& c = surface.Corner(i, 2);
    CHECK(std::abs(ball.Clearance(a)) < 0.05);
    volume += (a - Ball::kCenterMm).dot((b - Ball::kCenterMm).cross(c - Ball::kCenterMm)) / 6;
  }
  // A hole or a reversed triangle would reduce the volume.
  const double exact = 4.0 / 3.0 * std::numbers::pi * std::pow(Ball::kRadiusMm, 3);
  CHECK(volume == Approx(exact).epsilon(0.01));
}

TEST_CASE("A surface net has about the requested number of triangles") {
  const Ball ball;
  const Eigen::AlignedBox3d bounds(Ball::kCenterMm - Eigen::Vector3d::Constant(8),
                                   Ball::kCenterMm + Eigen::Vector3d::Constant(8));
  const auto count = static_cast<double>(SurfaceInAbout(3000, ball, bounds).triangles.size());
  CHECK(count == Approx(3000).epsilon(0.1));
}
