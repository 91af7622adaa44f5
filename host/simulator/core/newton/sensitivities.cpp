#include "host/simulator/core/newton/sensitivities.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

Sensitivities::Sensitivities(const WireModel& wire) : wire_(wire) {
  gradient_.Reserve(static_cast<std::size_t>(wire.max_segments()) + 1,
                    static_cast<std::size_t>(wire.spins()));
}

void Sensitivities::Add(ShadowWire& more, ShadowWire& less, double step) {
  const auto segments = static_cast<std::size_t>(wire_.max_segments()) + 1;
  Parameter& added = parameters_.emplace_back();
  added.more = &more;
  added.less = &less;
  added.step = step;
  added.derivative.Reserve(segments, static_cast<std::size_t>(wire_.spins()));
  added.nodes_mm.reserve(segments + 1);
  remembers_ = remembers_ || more.remembers();
}

void Sensitivities::Clear(std::size_t segments, Parameter& parameter) const {
  parameter.derivative.xi.assign(segments, Vector2d::Zero());
  parameter.derivative.spin.assign(segments * static_cast<std::size_t>(wire_.spins()), 0);
}

void Sensitivities::Restart(const WireState& state) {
  ended_ = true;
  for (Parameter& parameter : parameters_) {
    parameter.more->Restart(state);
    parameter.less->Restart(state);
    Clear(static_cast<std::size_t>(state.segments()), parameter);
    parameter.nodes_mm.assign(state.nodes().size(), Vector3d::Zero());
    parameter.unknown = Unknown::kNone;
  }
}

void Sensitivities::Lose() {
  for (Parameter& parameter : parameters_) {
    parameter.unknown = remembers_ ? Unknown::kHistoryLost : Unknown::kNotAtRest;
  }
}

void Sensitivities::BeginPart() {
  // The vessel has moved before the part ended.
  if (!ended_ && remembers_) Lose();
  ended_ = false;
  for (Parameter& parameter : parameters_) {
    parameter.more->BeginPart();
    parameter.less->BeginPart();
  }
}

void Sensitivities::MovePart(const PartMotion& motion, const WireState& state) {
  for (Parameter& parameter : parameters_) {
    parameter.more->MovePart(motion, state);
    parameter.less->MovePart(motion, state);
  }
}

namespace {

// Sets `out` to a more + b less, gradient by gradient.
void Combine(double a, const CurveQuadraticModel& more, double b, const CurveQuadraticModel& less,
             CurveStep& out) {
  out.xi.resize(more.gradient.size());
  out.spin.resize(more.spin_gradient.size());
  for (std::size_t i = 0; i < out.xi.size(); ++i) {
    out.xi[i] = a * more.gradient[i] + b * less.gradient[i];
  }
  for (std::size_t i = 0; i < out.spin.size(); ++i) {
    out.spin[i] = a * more.spin_gradient[i] + b * less.spin_gradient[i];
  }
}

// Adds `scale` times `step` to `sum`.
void AddScaled(double scale, const CurveStep& step, CurveStep& sum) {
  for (std::size_t i = 0; i < sum.xi.size(); ++i) sum.xi[i] += scale * step.xi[i];
  for (std::size_t i = 0; i < sum.spin.size(); ++i) sum.spin[i] += scale * step.spin[i];
}

}  // namespace

void Sensitivities::EndPart(const WireState& state, LinearizedBalance& balance) {
  constexpr double kMostOffMm = 0.02;  // for errors of some 1 %
  const bool is_stable = state.segments() == 0 || balance.Factor(state);
  // Terms that remember the way move their anchors at the state, so it must be near rest.
  const auto off_mm = [&](Parameter& any) {
    Clear(static_cast<std::size_t>(state.segments()), any);
    PlaceShadows(state, balance.frames(), any);
    Combine(0.5, any.more->model(), 0.5, any.less->model(), gradient_);
    return LongestMm(state, balance.frames(), balance.Solve(state, gradient_));
  };
  const bool is_near_rest = !is_stable || !remembers_ || state.segments() == 0 ||
                            parameters_.empty() || off_mm(parameters_.front()) <= kMostOffMm;
  for (Parameter& parameter : parameters_) {
    Clear(static_cast<std::size_t>(state.segments()), parameter);
    const bool was_lost = remembers_ && parameter.unknown != Unknown::kNone;
    if (was_lost) parameter.unknown = Unknown::kHistoryLost;
    if (was_lost || !is_stable || state.segments() == 0) {
      if (!was_lost) parameter.unknown = is_stable ? Unknown::kNone : Unknown::kUnstable;
      PlaceShadows(state, balance.frames(), parameter);
    } else if (!is_near_rest) {
      parameter.unknown = Unknown::kNotAtRest;
      PlaceShadows(state, balance.frames(), parameter);
    } else {
      parameter.unknown = Find(state, balance, parameter) ? Unknown::kNone : Unknown::kNotSmooth;
    }
    TakeNodes(state, balance.frames(), parameter);
    parameter.more->EndPart();
    parameter.less->EndPart();
  }
  ended_ = true;
}

void Sensitivities::PlaceShadows(const WireState& state, const std::vector<Frame>& frames,
                                 Parameter& of) {
  of.more->Place(state, frames, of.derivative, of.step);
  of.less->Place(state, frames, of.derivative, -of.step);
}

// Newton's method for the derivative, which is the root of a linear function. With the exact
// Hessian the first step finds it, and the second one confirms it. Leaves the shadows at the
// derivative.
bool Sensitivities::Find(const WireState& state, LinearizedBalance& balance, Parameter& of) {
  constexpr int kMostSteps = 20;
  constexpr double kTolerance = 1e-6;    // of the derivative
  constexpr double kRoundingMm = 1e-12;  // of a position
  constexpr double kSmooth = 1e-3;       // of the derivative, after the last step
  PlaceShadows(state, balance.frames(), of);
  double change_mm = 0;
  double size_mm = 0;
  for (int k = 0; k < kMostSteps; ++k) {
    Combine(0.5 / of.step, of.more->model(), -0.5 / of.step, of.less->model(), gradient_);
    const CurveStep& step = balance.Solve(state, gradient_);
    change_mm = LongestMm(state, balance.frames(), step);
    if (!std::isfinite(change_mm)) return false;
    if (k > 0 && (change_mm <= kTolerance * size_mm || change_mm * of.step <= kRoundingMm)) {
      return true;
    }
    AddScaled(1, step, of.derivative);
    size_mm = LongestMm(state, balance.frames(), of.derivative);
    PlaceShadows(state, balance.frames(), of);
  }
  return change_mm <= kSmooth * size_mm;
}

double Sensitivities::LongestMm(const WireState& state, const std::vector<Frame>& frames,
                                const CurveStep& step) const {
  double squared = 0;
  Vector3d moved_mm = Vector3d::Zero();
  for (int i = 0; i < state.segments(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    moved_mm += state.SegmentLength(wire_, i) * (frames[at] * step.xi[at]);
    squared = std::max(squared, moved_mm.squaredNorm());
  }
  return std::sqrt(squared);
}

void Sensitivities::TakeNodes(const WireState& state, const std::vector<Frame>& frames,
                              Parameter& of) const {
  of.nodes_mm.resize(state.nodes().size());
  Vector3d moved_mm = Vector3d::Zero();
  of.nodes_mm.front() = moved_mm;
  for (int i = 0; i < state.segments(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    moved_mm += state.SegmentLength(wire_, i) * (frames[at] * of.derivative.xi[at]);
    of.nodes_mm[at + 1] = moved_mm;
  }
}

void Sensitivities::CopyFrom(const Sensitivities& twin) {
  for (std::size_t k = 0; k < parameters_.size(); ++k) {
    parameters_[k].derivative = twin.parameters_[k].derivative;
    parameters_[k].nodes_mm = twin.parameters_[k].nodes_mm;
    parameters_[k].unknown = twin.parameters_[k].unknown;
  }
  ended_ = twin.ended_;
}

Sensitivities::Unknown Sensitivities::unknown(std::size_t parameter) const {
  const Unknown reason = parameters_[parameter].unknown;
  return reason == Unknown::kNone && !ended_ ? Unknown::kNotAtRest : reason;
}

}  // namespace torquer
