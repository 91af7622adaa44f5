#include "host/study/wire_comparison.h"

#include <algorithm>
#include <cmath>

#include "host/simulator/core/newton/newton_relaxation.h"

namespace torquer::study {
namespace {

using Eigen::Vector3d;

// Point of a wire at a given distance from its distal end along the polyline.
Vector3d PointFromTip(const WireModel& model, const WireState& state, double from_tip_mm) {
  const double lambda = model.segment_mm();
  const int last = state.segments() - 1;
  const int segment = std::max(0, last - static_cast<int>(from_tip_mm / lambda));
  const double past = from_tip_mm - lambda * (last - segment);
  return state.nodes()[static_cast<std::size_t>(segment) + 1] -
         past * state.tangents()[static_cast<std::size_t>(segment)];
}

WireState ComeToRest(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                     const WireState& from) {
  const std::vector<EnergyTerm*> none;
  NewtonSettings settings;
  settings.tolerance = 1e-7;
  NewtonRelaxation newton(model, field, wall, settings, none);
  WireState state = from;
  newton.Restart(state);
  CountedBudget budget(3000);
  newton.Tick({state.insertion_mm(), state.rotation_rad()}, budget, state);
  return state;
}

}  // namespace

WireState Recut(const WireModel& model, const WireState& from) {
  std::vector<Vector3d> path(from.nodes().begin() + 1, from.nodes().end());
  // Chords are shorter than the arc, so the path is extended by one segment for the last node.
  if (from.segments() > 0)
    path.emplace_back(path.back() + model.segment_mm() * from.tangents().back());
  return WireState::Along(model, path, {from.insertion_mm(), from.rotation_rad()});
}

std::vector<double> Distances(const WireModel& model_a, const WireState& a,
                              const WireModel& model_b, const WireState& b) {
  constexpr double kStepMm = 0.5;
  std::vector<double> distances;
  if (a.segments() == 0 || b.segments() == 0) return distances;
  for (double s = 0; s <= std::min(a.insertion_mm(), b.insertion_mm()); s += kStepMm) {
    distances.push_back((PointFromTip(model_a, a, s) - PointFromTip(model_b, b, s)).norm());
  }
  return distances;
}

WireDistance Compare(const WireModel& model_a, const WireState& a, const WireModel& model_b,
                     const WireState& b) {
  WireDistance distance;
  const std::vector<double> distances = Distances(model_a, a, model_b, b);
  for (const double d : distances) {
    distance.mean_mm += d / static_cast<double>(distances.size());
    distance.max_mm = std::max(distance.max_mm, d);
  }
  return distance;
}

double DeepestPenetration(const WireModel& model, const ClearanceField& field,
                          const WireState& state) {
  constexpr double kStepMm = 0.1;
  double deepest = 0;
  const int n = state.segments();
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const double length = state.SegmentLength(model, i);
    const int parts = std::max(1, static_cast<int>(std::ceil(length / kStepMm)));
    for (int part = 1; part <= parts; ++part) {
      const Vector3d at = state.nodes()[k] + (length * part / parts) * state.tangents()[k];
      deepest = std::max(deepest, model.radius_mm(n - 1 - i) - field.Clearance(at));
    }
  }
  return deepest;
}

double ResidualPerLength(const WireModel& model, const WireState& state,
                         const std::vector<Eigen::Vector2d>& gradient) {
  double largest = 0;
  const int n = state.segments();
  for (int i = 0; i < n; ++i) {
    largest = std::max(largest, gradient[static_cast<std::size_t>(i)].norm() /
                                    (state.SegmentLength(model, i) * model.rigidity_N_mm2(n - i)));
  }
  return largest;
}

bool InOneBasin(const WireModel& model, const ClearanceField& field, const WallModel& wall,
                const WireState& a, const WireState& b, double tolerance_mm) {
  const WireState rest_a = ComeToRest(model, field, wall, a);
  const WireState rest_b = ComeToRest(model, field, wall, b);
  return Compare(model, rest_a, model, rest_b).max_mm < tolerance_mm;
}

}  // namespace torquer::study
