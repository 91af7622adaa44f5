#include "host/simulator/core/paper/physical_relaxation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;

PhysicalRelaxation::PhysicalRelaxation(const WireModel& model, const ClearanceField& field,
                                       const WallModel& wall, const PhysicalSettings& settings)
    : model_(model),
      field_(field),
      wall_(wall),
      settings_(settings),
      lipschitz_(field.LipschitzBound()) {
  free_mm_.reserve(model.max_segments() + 2);
}

void PhysicalRelaxation::CopyFrom(const PhysicalRelaxation& twin) {
  free_mm_ = twin.free_mm_;
  iteration_ = twin.iteration_;
  next_ = twin.next_;
  sum_squared_update_ = twin.sum_squared_update_;
  cycle_updates_ = twin.cycle_updates_;
  last_cycle_rms_ = twin.last_cycle_rms_;
  updates_ = twin.updates_;
  lookups_ = twin.lookups_;
}

void PhysicalRelaxation::Restart(WireState& state) {
  free_mm_.assign(state.nodes().size(), -1);
  state.UpdateFrames(model_);
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
    field_.EvaluateGradient(state.nodes()[j], sample);
    ++lookups_;
    free_mm_[j] = (sample.clearance_mm - radius) / lipschitz_;
    if (sample.clearance_mm >= radius) continue;
    const double stiffness = wall_.stiffness_N_mm2 * NodeLength(model_, state, j);
    sum -= (stiffness * (radius - sample.clearance_mm)) * sample.gradient;
  }
  return sum;
}

namespace {

// Step of a segment by the size of the force across it, and the force along it.
double StepBy(UpdateRule rule, double size, double along, double rho) {
  switch (rule) {
    case UpdateRule::kSigned:
      return size / (rho - along);
    case UpdateRule::kRhoOnly:
      return size / rho;
    case UpdateRule::kAbsolute:
      return size / std::abs(rho - along);
    case UpdateRule::kExactRoot:
      break;
  }
  // With a = 2 lambda sin(phi/2) the equation reads tan phi = |B_perp| / (rho - B_par). The root in
  // (0, pi) is the minimum. The step is the chord of that turn.
  return 2 * std::sin(std::atan2(size, rho - along) / 2);
}

}  // namespace

double PhysicalRelaxation::Update(int segment, WireState& state) {
  const int n = state.segments();
  const double length = state.SegmentLength(model_, segment);
  const Vector3d u = state.tangents()[segment];

  // (6), (8), (10'); with EI(s) each joint has its own spring constant.
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
        state.tangents()[segment + 1] - RestDirection(model_, state, segment + 1);  // epsilon
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

  double step = StepBy(settings_.rule, size, along, rho);
  // (18). A chord longer than two radii is geometrically impossible even without that bound.
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
  if (!(norm > 1e-6)) return 0;  // no direction: the step is exactly u's length backwards
  tangent /= norm;

  state.TurnSegment(model_, segment, tangent);
  const double distance = (length * (tangent - u)).norm();
  for (int j = segment + 1; j <= n; ++j) free_mm_[j] -= distance;
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
    // The increments of nodes and frames accumulate rounding errors; every cycle recomputes them.
    state.Rebuild(model_);
    free_mm_.assign(state.nodes().size(), -1);
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
