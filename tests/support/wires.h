// Wires for tests, and operations that many tests use.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "host/simulator/core/energy_term.h"
#include "host/simulator/core/relaxation.h"
#include "host/simulator/core/wire_mechanics.h"
#include "host/simulator/core/wire_model.h"
#include "host/simulator/core/wire_state.h"
#include "host/study/cases/simple_wire.h"

namespace torquer::test {

using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

using study::MakeWire;
using study::WireParameters;

/// Wire straight out of the sheath.
WireState LayStraight(const WireModel& model, double length_mm);

/// State after every tangent took the step xi in its tangent plane, with normals transported in
/// time. WireMechanics expands the energy along this motion.
template <class AnyCurve>
AnyCurve Stepped(const WireModel& model, const AnyCurve& from, const std::vector<Vector2d>& xi);

/// State with every normal turned about its tangent.
WireState Spun(const WireModel& model, const WireState& from, const std::vector<double>& angle_rad);

/// State after every segment took its step xi and then its spin: three numbers per segment.
WireState StepAndSpin(const WireModel& model, const WireState& from, const Eigen::VectorXd& x);

/// Turns every segment randomly by up to about `angle_rad`; frames stay untwisted.
void Shake(const WireModel& model, double angle_rad, std::mt19937& random, Curve& state);

/// Wire with these tangents and untwisted frames; as long as `like`.
WireState WithTangents(const WireModel& model, const WireState& like,
                       const std::vector<Vector3d>& tangents);

/// Wire in which one segment has another direction; frames are untwisted.
WireState WithTangent(const WireModel& model, const WireState& like, std::size_t segment,
                      const Vector3d& tangent);

/// Random wire: every segment turns against the previous one by up to `bend_rad`.
WireState Wander(const WireModel& model, double length_mm, double bend_rad, std::mt19937& random);

/// Dead force at the distal end.
class EndForce final : public EnergyTerm {
 public:
  explicit EndForce(const Vector3d& force_N) : force_N_(force_N) {}
  void SetForce(const Vector3d& force_N) { force_N_ = force_N; }
  /// Acts on the end of this curve, not of the farthest one.
  void ActOn(int curve) { curve_ = curve; }
  void Begin(const PointSet&) override {}
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void End(const PointSet&) override {}
  void Reset() override {}
  std::uint64_t Hash(std::uint64_t seed) const override { return seed; }

 private:
  Vector3d force_N_;
  int curve_ = -1;
};

/// One point of a wire of radius 0.2 mm that stands for 1 mm. It is `penetration_mm` deep in a wall
/// of 1 N/mm^2 that faces +z, so it presses with as many N.
PointSet PressedPoint(double penetration_mm);

/// Ticks with the same target until one converges; returns the last report.
TickReport Settle(Relaxation& relaxation, const InstrumentPoses& target, WireState& state,
                  int most_ticks = 50);

/// Largest distance in mm between the nodes of two states with equally many segments.
double LargestDistance(const Curve& a, const Curve& b);

}  // namespace torquer::test
