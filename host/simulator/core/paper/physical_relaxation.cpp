#include "host/simulator/core/paper/physical_relaxation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

PhysicalRelaxation::PhysicalRelaxation(const WireModel& model, const ClearanceField& field,
                                       const WallModel& wall, const PhysicalSettings& settings)
    : model_(model),
      field_(field),
      wall_(wall),
      settings_(settings),
      lipschitz_(field.LipschitzBound()) {
  free_mm_.reserve(static_cast<std::size_t>(model.max_segments()) + 2);
}

void PhysicalRelaxation::Restart(WireState& state) {
  free_mm_.assign(state.nodes.size(), -1);
  UpdateSpin(model_, state);
  InterruptCycle();
}

Vector3d PhysicalRelaxation::WallGradient(int first_node, const WireState& state) {
  // (9): G_i = sum over j >= i of the gradients of the surface energy.
  const int n = state.segments();
  Vector3d sum = Vector3d::Zero();
  for (int j = first_node; j <= n; ++j) {
    if (settings_.skip_lookups && free_mm_[j] > 0) continue;
    const double radius = model_.radius_mm(n - j);
    ClearanceSample sample;
    field_.EvaluateGradient(state.nodes[j], sample);
    ++lookups_;
    free_mm_[j] = (sample.clearance_mm - radius) / lipschitz_;
    if (sample.clearance_mm >= radius) continue;
    const double stiffness = wall_.stiffness_N_mm2 * state.SegmentLength(model_, j - 1);
    sum -= (stiffness * (radius - sample.clearance_mm)) * sample.gradient;
  }
  return sum;
}

void PhysicalRelaxation::TurnSpin(int segment, const Vector3d& old_tangent,
                                  const Vector3d& old_normal, WireState& state) const {
  const int n = state.segments();
  const int curved = model_.first_straight_joint();
  if (curved <= 1) return;
  const auto times = [](const Vector2d& a, const Vector2d& b) {
    return Vector2d(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]);
  };
  const auto conjugate = [](const Vector2d& a) { return Vector2d(a[0], -a[1]); };
  const Vector3d& before = segment == 0 ? model_.sheath().direction : state.tangents[segment - 1];
  const Vector3d& normal = segment == 0 ? model_.sheath_normal() : state.normals[segment - 1];
  const Vector3d& tangent = state.tangents[segment];
  const Vector3d& own = state.normals[segment];
  Vector2d change = times(SpinFactor(before, normal, tangent, own),
                          conjugate(SpinFactor(before, normal, old_tangent, old_normal)));
  for (int joint = segment + 1; joint < n; ++joint) {
    if (joint == segment + 2) {
      const Vector3d& after = state.tangents[segment + 1];
      const Vector3d& target = state.normals[segment + 1];
      change = times(change, times(SpinFactor(tangent, own, after, target),
                                   conjugate(SpinFactor(old_tangent, old_normal, after, target))));
      joint = std::max(joint, n - curved + 1);
      if (joint >= n) return;
    }
    const int from_tip = n - joint;
    if (from_tip < curved) state.spin[from_tip] = times(state.spin[from_tip], change);
  }
}

double PhysicalRelaxation::Update(int segment, WireState& state) {
  const int n = state.segments();
  const double length = state.SegmentLength(model_, segment);
  const Vector3d u = state.tangents[segment];

  // (6), (8), (10'); for EI(s) each joint brings its own spring constant.
  Vector3d pull = Vector3d::Zero();
  double rho = 0;
  {
    const Vector3d to_rest = RestDirection(model_, state, segment) - u;  // eta
    const double c = JointStiffness(model_, state, segment);
    const double p = EvaluateBending(model_.law(), to_rest.squaredNorm() / 2).slope;
    pull += c * p * to_rest;
    rho += c * p;
  }
  if (segment + 1 < n) {
    const Vector3d bend =
        state.tangents[segment + 1] - RestDirection(model_, state, segment + 1);  // epsilon
    const double c = JointStiffness(model_, state, segment + 1);
    const double q = EvaluateBending(model_.law(), bend.squaredNorm() / 2).slope;
    pull += c * q * bend;
    rho += c * q;
  }
  rho /= length;
  const Vector3d force = WallGradient(segment + 1, state) - pull / length;
  const double along = u.dot(force);
  const Vector3d across = force - along * u;  // u x (B x u)
  const double size = across.norm();
  ++updates_;
  ++cycle_updates_;
  if (size == 0) return 0;

  double step = 0;
  switch (settings_.rule) {
    case UpdateRule::kSigned:
      step = size / (rho - along);
      break;
    case UpdateRule::kRhoOnly:
      step = size / rho;
      break;
    case UpdateRule::kAbsolute:
      step = size / std::abs(rho - along);
      break;
    case UpdateRule::kExactRoot:
      // With a = 2 lambda sin(phi/2) the equation reads tan phi = |B_perp| / (rho - B_par); the
      // root in (0, pi) is the minimum. The chord of that turn:
      step = 2 * std::sin(std::atan2(size, rho - along) / 2);
      break;
  }
  // (18). A turn by more than two radii is geometrically impossible even without that bound.
  const double bound =
      std::min(2.0, settings_.max_update / std::sqrt(static_cast<double>(n - segment)));
  if (!(std::abs(step) <= bound)) step = std::copysign(bound, step);

  Vector3d tangent;
  if (settings_.rule == UpdateRule::kExactRoot) {
    const double phi = 2 * std::asin(step / 2);
    tangent = std::cos(phi) * u - (std::sin(phi) / size) * across;
  } else {
    tangent = u - (step / size) * across;
  }
  const double norm = tangent.norm();
  if (!(norm > 1e-6)) return 0;  // a step of exactly u's length backwards has no direction
  tangent /= norm;

  const Vector3d old_normal = state.normals[segment];
  state.tangents[segment] = tangent;
  state.normals[segment] = ParallelTransport(old_normal, u, tangent);
  TurnSpin(segment, u, old_normal, state);

  const Vector3d move = length * (tangent - u);
  const double distance = move.norm();
  for (int j = segment + 1; j <= n; ++j) {
    state.nodes[j] += move;
    free_mm_[j] -= distance;
  }
  sum_squared_update_ += step * step;
  return std::abs(step);
}

int PhysicalRelaxation::TipIterations(const WireState& state) const {
  return std::min(model_.tip_segments() + settings_.margin, state.segments());
}

void PhysicalRelaxation::RelaxTip(WireState& state) {
  const int n = state.segments();
  const int m = TipIterations(state);
  for (int k = 1; k <= m; ++k) {
    for (int j = 0; j < k; ++j) Update(n - 1 - j, state);
  }
  // The paper's segments n - m - 5, n - m - 10, ..
  for (int i = n - m - settings_.margin; i >= 1; i -= settings_.margin) Update(i - 1, state);
}

bool PhysicalRelaxation::ContinueCycle(std::int64_t updates, WireState& state) {
  const int n = state.segments();
  const int iterations = std::min(n, static_cast<int>(std::ceil(settings_.cycle_fraction * n)));
  if (iteration_ == 1 && next_ == 0) {
    // The increments of nodes and spin gather rounding; once a cycle they are made anew.
    PlaceNodes(model_, 1, state);
    UpdateSpin(model_, state);
    free_mm_.assign(state.nodes.size(), -1);
    sum_squared_update_ = 0;
    cycle_updates_ = 0;
  }
  for (; updates > 0; --updates) {
    if (iteration_ > iterations) break;
    Update(n - 1 - next_, state);
    if (++next_ == iteration_) {
      ++iteration_;
      next_ = 0;
    }
  }
  if (iteration_ <= iterations) return false;
  last_cycle_rms_ = mean_update_rms();
  InterruptCycle();
  return true;
}

double PhysicalRelaxation::mean_update_rms() const {
  if (cycle_updates_ == 0) return last_cycle_rms_;
  return std::sqrt(sum_squared_update_ / static_cast<double>(cycle_updates_));
}

}  // namespace torquer
