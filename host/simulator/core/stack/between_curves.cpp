#include "host/simulator/core/stack/between_curves.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;
using Vector = BetweenCurves::Vector;

namespace {

// Within this of the lumen's wall a place takes part in the model of a step.
constexpr double kNearLumenMm = 0.05;

// The segments of both curves that a place lies on.
struct Across {
  const WireState& inner;
  const WireState& outer;
  const Frame& inner_frame;
  const Frame& outer_frame;
  Eigen::Index inner_at;  // of its displacement in a Vector
  Eigen::Index outer_at;
};

// How a component along `way` of the inner curve's place, against that of the outer one, follows
// from the steps. The place is `t` past the distal node of its segment (negative), the outer one's
// `beyond` farther along its own.
Vector Follow(const Across& at, const Vector3d& way, double t, double beyond) {
  Vector row;
  row.segment<3>(at.inner_at) = way;
  row.segment<2>(at.inner_at + 3) = t * (at.inner_frame.transpose() * way);
  row.segment<3>(at.outer_at) = -way;
  row.segment<2>(at.outer_at + 3) = -(t + beyond) * (at.outer_frame.transpose() * way);
  return row;
}

}  // namespace

void BetweenCurves::Reserve(int segments, int points_per_segment) {
  const auto n = static_cast<std::size_t>(segments) + 1;
  springs.reserve(n * static_cast<std::size_t>(points_per_segment) + 1);
  terms.reserve(n);
}

void BetweenCurves::Place(const InstrumentStack& stack, const WireState& state,
                          int points_per_segment, const std::vector<Frame>& frames,
                          const std::vector<Frame>& second_frames) {
  springs.clear();
  energy_mJ = pressed_N = end_pressed_N = largest_offset_mm = 0;
  const WireState& second = *state.second();
  const int n = second.segments();
  terms.resize(static_cast<std::size_t>(n));
  if (n == 0) return;
  const bool outer_leads = state.outer_leads();
  const WireModel& inner_rod = outer_leads ? *stack.second_rod() : stack.rod();
  const WireState& inner = outer_leads ? second : state;
  const WireState& outer = outer_leads ? state : second;
  const double lambda = inner_rod.segment_mm();
  const double reach_mm = stack.SecondReach(state.places());
  for (int i = 0; i < n; ++i) {
    const auto s = static_cast<std::size_t>(i);
    const double begin_mm = i == 0 ? 0 : state.first_segment_mm() + (i - 1) * lambda;
    const double length_mm = i == 0 ? state.first_segment_mm() : lambda;
    const double piece = length_mm / points_per_segment;
    const double end_mm = reach_mm - begin_mm;
    const double radius_mm = inner_rod.radius_mm(inner.segments() - 1 - i);
    const Across at{inner,
                    outer,
                    (outer_leads ? second_frames : frames)[s],
                    (outer_leads ? frames : second_frames)[s],
                    outer_leads ? 5 : 0,
                    outer_leads ? 0 : 5};
    const auto press = [&](double t, double weight_mm, bool end) {
      const Vector3d& along = outer.tangents()[s];
      const Vector3d apart =
          inner.nodes()[s] + t * inner.tangents()[s] - outer.nodes()[s] - t * along;
      const double beyond = along.dot(apart);
      const Vector3d across = apart - beyond * along;
      const double offset_mm = across.norm();
      const double lumen_mm = stack.LumenRadius(state.places(), begin_mm + t);
      largest_offset_mm = std::max(largest_offset_mm, offset_mm);
      const double penetration_mm = offset_mm - (lumen_mm - radius_mm);
      if (penetration_mm < -kNearLumenMm || !(offset_mm > 1e-9)) return;
      Spring& spring = springs.emplace_back();
      spring.segment = i;
      spring.stiffness_N_mm = stack.clearance().stiffness_N_mm2 * weight_mm;
      spring.penetration_mm = penetration_mm;
      const Vector3d normal = across / offset_mm;
      const double past_end_mm = t - length_mm;
      spring.approach = Follow(at, normal, past_end_mm, beyond);
      if (penetration_mm <= 0) return;
      const double force_N = spring.stiffness_N_mm * penetration_mm;
      energy_mJ += force_N * penetration_mm / 2;
      pressed_N += force_N;
      if (end) end_pressed_N += force_N;
      const Vector sideways = Follow(at, along.cross(normal), past_end_mm, beyond);
      const Vector onwards = Follow(at, along, past_end_mm, beyond);
      Vector tilt = Vector::Zero();
      tilt.segment<2>(at.outer_at + 3) = at.outer_frame.transpose() * normal;
      spring.curvature = (force_N / offset_mm) * sideways * sideways.transpose() -
                         (force_N * offset_mm) * tilt * tilt.transpose();
      const BetweenCurves::Matrix turned = force_N * tilt * onwards.transpose();
      spring.curvature -= turned + turned.transpose();
      // Third term of (4).
      const double bent = force_N * past_end_mm * normal.dot(inner.tangents()[s]);
      spring.curvature(at.inner_at + 3, at.inner_at + 3) -= bent;
      spring.curvature(at.inner_at + 4, at.inner_at + 4) -= bent;
    };
    for (int k = 1; k <= points_per_segment; ++k) {
      const double t = piece * k;
      const double next = k < points_per_segment ? piece : lambda / points_per_segment;
      const double left_mm = std::max(0.0, end_mm - t);
      if (left_mm > 0) press(t, std::min(piece / 2, left_mm) + std::min(next / 2, left_mm), false);
    }
    // An edge presses along about as much of what it touches as it is wide.
    if (i == n - 1 && end_mm > 0) {
      press(end_mm, stack.LumenRadius(state.places(), reach_mm), true);
    }
  }
}

void BetweenCurves::Add(const Spring& spring) {
  Terms& to = terms[static_cast<std::size_t>(spring.segment)];
  if (!to.any) {
    to.any = true;
    to.gradient.setZero();
    to.hessian.setZero();
  }
  to.gradient += (spring.stiffness_N_mm * spring.penetration_mm) * spring.approach;
  to.hessian += spring.stiffness_N_mm * spring.approach * spring.approach.transpose();
  if (spring.penetration_mm > 0) to.hessian += spring.curvature;
}

}  // namespace torquer
