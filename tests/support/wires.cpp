#include "tests/support/wires.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace torquer::test {

WireState LayStraight(const WireModel& model, double length_mm) {
  return WireState::Along(model, {}, {length_mm, 0});
}

template <class AnyCurve>
AnyCurve Stepped(const WireModel& model, const AnyCurve& from, const std::vector<Vector2d>& xi) {
  std::vector<Vector3d> tangents = from.tangents();
  std::vector<Vector3d> normals = from.normals();
  for (std::size_t i = 0; i < xi.size(); ++i) {
    const Vector3d& u = from.tangents()[i];
    const Vector3d& a = from.normals()[i];
    const Vector3d b = u.cross(a);
    const double angle = xi[i].norm();
    if (angle == 0) continue;
    const Vector3d axis = (xi[i][0] * b - xi[i][1] * a) / angle;
    const Eigen::AngleAxisd turn(angle, axis);
    tangents[i] = (turn * u).normalized();
    normals[i] = turn * a;
    normals[i] -= normals[i].dot(tangents[i]) * tangents[i];
    normals[i].normalize();
  }
  AnyCurve to = from;
  to.SetDirections(model, tangents, normals);
  to.UpdateFrames(model);
  return to;
}

template Curve Stepped(const WireModel&, const Curve&, const std::vector<Vector2d>&);
template WireState Stepped(const WireModel&, const WireState&, const std::vector<Vector2d>&);

WireState Spun(const WireModel& model, const WireState& from,
               const std::vector<double>& angle_rad) {
  std::vector<Vector3d> normals = from.normals();
  for (std::size_t i = 0; i < normals.size(); ++i) {
    normals[i] = Eigen::AngleAxisd(angle_rad[i], from.tangents()[i]) * normals[i];
  }
  WireState to = from;
  to.SetDirections(model, from.tangents(), normals);
  return to;
}

WireState StepAndSpin(const WireModel& model, const WireState& from, const Eigen::VectorXd& x) {
  std::vector<Vector2d> xi;
  std::vector<double> zeta;
  for (Eigen::Index i = 0; i + 2 < x.size(); i += 3) {
    xi.emplace_back(x[i], x[i + 1]);
    zeta.push_back(x[i + 2]);
  }
  WireState to = Spun(model, Stepped(model, from, xi), zeta);
  to.UpdateFrames(model);
  return to;
}

void Shake(const WireModel& model, double angle_rad, std::mt19937& random, Curve& state) {
  std::uniform_real_distribution<double> turn(-angle_rad, angle_rad);
  std::vector<Vector2d> xi;
  for (int i = 0; i < state.segments(); ++i) {
    const double first = turn(random);
    xi.emplace_back(first, turn(random));
  }
  state = Stepped(model, state, xi);
  state.UntwistFrames(model);
}

WireState WithTangents(const WireModel& model, const WireState& like,
                       const std::vector<Vector3d>& tangents) {
  WireState state = like;
  state.TurnDistal(model, {tangents.rbegin(), tangents.rend()});
  state.UntwistFrames(model);
  return state;
}

WireState WithTangent(const WireModel& model, const WireState& like, std::size_t segment,
                      const Vector3d& tangent) {
  std::vector<Vector3d> tangents = like.tangents();
  tangents[segment] = tangent.normalized();
  return WithTangents(model, like, tangents);
}

WireState Wander(const WireModel& model, double length_mm, double bend_rad, std::mt19937& random) {
  const WireState straight = LayStraight(model, length_mm);
  std::vector<Vector3d> tangents = straight.tangents();
  std::uniform_real_distribution<double> turn(-bend_rad, bend_rad);
  Vector3d u = model.sheath().direction;
  for (Vector3d& tangent : tangents) {
    for (int axis = 0; axis < 3; ++axis) u[axis] += turn(random);
    u.normalize();
    tangent = u;
  }
  return WithTangents(model, straight, tangents);
}

double EndForce::Add(const PointSet& points, PointDerivatives& out) const {
  if (curve_ < 0 ? !points.among.is_farthest : points.among.curve != curve_) return 0;
  const int q = points.size() - 1;
  if (q < 0) return 0;
  out.Touch(q);
  out.gradient[static_cast<std::size_t>(q)] -= force_N_;
  return -force_N_.dot(points.position[static_cast<std::size_t>(q)]);
}

PointSet PressedPoint(double penetration_mm) {
  PointSet points;
  points.per_segment = 1;
  points.position = {Vector3d::Zero()};
  points.weight_mm = {1};
  points.radius_mm = {0.2};
  points.touches = {1};
  points.near = {0};
  points.stiffness_N_mm2 = {1};
  points.clearance.resize(1);
  points.clearance[0].gradient = Vector3d::UnitZ();
  points.clearance[0].clearance_mm = 0.2 - penetration_mm;
  return points;
}

TickReport Settle(Relaxation& relaxation, const InstrumentPoses& target, WireState& state,
                  int most_ticks) {
  TickReport report;
  for (int k = 0; k < most_ticks; ++k) {
    CountedBudget budget(100000);
    report = relaxation.Tick(target, budget, state);
    if (report.converged && report.arrived()) break;
  }
  return report;
}

double LargestDistance(const Curve& a, const Curve& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.nodes().size(); ++i) {
    largest = std::max(largest, (a.nodes()[i] - b.nodes()[i]).norm());
  }
  return largest;
}

}  // namespace torquer::test
