// Artificial energies of spins: of a spin with a point, and of two spins.
#pragma once

#include <cmath>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/frames.h"
#include "tests/support/wires.h"

namespace torquer::test {

/// Spring that couples a point with the spin of its segment: k (b.(x - x_0) + phi)^2 / 2. Here phi
/// is the segment's turn about its axis since the start.
class RollSpring final : public EnergyTerm {
 public:
  explicit RollSpring(int point) : point_(point) {}
  void Begin(const PointSet& points) override {
    place_ = points.position[static_cast<std::size_t>(point_)];
    tangent_ = points.Tangent(point_);
    normal_ = points.Normal(point_);
  }
  double Add(const PointSet& points, PointDerivatives& out) const override {
    if (normal_.isZero(0)) return 0;
    const auto p = static_cast<std::size_t>(point_);
    const Vector3d u = points.Tangent(point_);
    const Vector3d from = ParallelTransport(normal_, tangent_, u);
    const Vector3d to = points.Normal(point_);
    const double phi = std::atan2(from.cross(to).dot(u), from.dot(to));
    const double stretch = kPull.dot(points.position[p] - place_) + phi - 0.3;
    out.Touch(point_);
    out.gradient[p] += kStiffness * stretch * kPull;
    if (out.with_hessian) out.hessian[p] += kStiffness * kPull * kPull.transpose();
    out.on_spins.push_back({point_, kStiffness * stretch, kStiffness, kStiffness * kPull, 0,
                            points.SurfaceAt(point_)});
    return kStiffness * stretch * stretch / 2;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  static inline const Vector3d kPull{0.3, -0.2, 0.5};
  static constexpr double kStiffness = 4e-3;
  int point_;
  Vector3d place_ = Vector3d::Zero();
  Vector3d tangent_ = Vector3d::Zero();
  Vector3d normal_ = Vector3d::Zero();
};

/// Spring that holds the innermost instrument against the turn of the next outer one.
class BetweenSpring final : public EnergyTerm {
 public:
  explicit BetweenSpring(int segment) : segment_(segment) {}
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override {
    const auto& turns = points.instruments.angles_rad[static_cast<std::size_t>(segment_)];
    const double stretch = turns[0] - turns[1] - 0.3;
    out.between.push_back({segment_, 0, 1, kStiffness * stretch, kStiffness});
    return kStiffness * stretch * stretch / 2;
  }
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  static constexpr double kStiffness = 6e-3;
  int segment_;
};

}  // namespace torquer::test
