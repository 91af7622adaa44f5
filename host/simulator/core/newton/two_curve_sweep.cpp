#include "host/simulator/core/newton/two_curve_sweep.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace torquer {

using Eigen::Matrix;
using Eigen::Vector2d;
using Eigen::Vector3d;
using TwoCurveSweep = RiccatiSweep<TwoCurveStage>;

TwoCurveSweep::RiccatiSweep(int max_segments) {
  const auto n = static_cast<std::size_t>(max_segments) + 1;
  gains_.reserve(n);
  checkpoints_.reserve(n / kSpacing + 1);
  second_step_.reserve(n);
  second_displacement_mm_.reserve(n);
}

// One stage, from what lies beyond it. In the given of a stage curve c has rows 6c .. 6c + 5, and
// in its control rows 2c and 2c + 1.
template <int kCurves>
bool TwoCurveSweep::Stage(const WireModel& model, const WireState& state,
                          const Expansion& expansion, double weight, int i, CostToGo<kCurves>& v) {
  constexpr int kGiven = kCurve * kCurves;
  constexpr int kControl = 2 * kCurves;
  const auto at = static_cast<std::size_t>(i);
  const double length = state.SegmentLength(model, i);
  const Expansion* const of[2] = {&expansion, kCurves == 2 ? &expansion.second.front() : nullptr};
  const WireState* const curve[2] = {&state, kCurves == 2 ? state.second() : nullptr};

  // How far the steps turn the untwisted frames, (36); nothing where a curve rests straight.
  Vector2d turn_before[2];
  Vector2d turn_own[2];
  const RestSpinTerms* rest[2];
  for (int c = 0; c < kCurves; ++c) {
    turn_before[c].setZero();
    turn_own[c].setZero();
    rest[c] = nullptr;
    if (of[c]->turns.empty()) continue;
    const TurnTerms& turn = of[c]->turns[at];
    turn_before[c] = turn.proximal;
    turn_own[c] = turn.distal;
    rest[c] = &turn.rest;
  }

  // What lies beyond, with what the given and the control make of its given: P times the control's
  // columns first.
  Matrix<double, kGiven, kControl> pb;
  for (int c = 0; c < kCurves; ++c) {
    const Frame& frame = of[c]->frames[at];
    pb.template middleCols<2>(2 * c) = length * (v.p.template middleCols<3>(kCurve * c) * frame) +
                                       v.p.template middleCols<2>(kCurve * c + 3) +
                                       v.p.col(kCurve * c + 5) * turn_own[c].transpose();
  }
  Matrix<double, kControl, kControl> pivot;
  Matrix<double, kControl, kGiven, Eigen::RowMajor> with;
  Matrix<double, kControl, 1> constant;
  Matrix<double, kGiven, kGiven> given;
  Matrix<double, kGiven, 1> own;
  for (int c = 0; c < kCurves; ++c) {
    const int k = kCurve * c;
    const Frame& frame = of[c]->frames[at];
    pivot.template middleRows<2>(2 * c) =
        length * (frame.transpose() * pb.template middleRows<3>(k)) +
        pb.template middleRows<2>(k + 3) + turn_own[c] * pb.row(k + 5);
    with.template middleCols<3>(k) = pb.template middleRows<3>(k).transpose();
    with.template middleCols<2>(k + 3) = pb.row(k + 5).transpose() * turn_before[c].transpose();
    with.col(k + 5) = pb.row(k + 5).transpose();
    constant.template segment<2>(2 * c) =
        length * (frame.transpose() * v.g.template segment<3>(k)) + v.g.template segment<2>(k + 3) +
        v.g[k + 5] * turn_own[c];
    own.template segment<3>(k) = v.g.template segment<3>(k);
    own.template segment<2>(k + 3) = v.g[k + 5] * turn_before[c];
    own[k + 5] = v.g[k + 5];
    for (int d = 0; d < kCurves; ++d) {
      const int m = kCurve * d;
      given.template block<3, 3>(k, m) = v.p.template block<3, 3>(k, m);
      given.template block<3, 2>(k, m + 3) =
          v.p.template block<3, 1>(k, m + 5) * turn_before[d].transpose();
      given.template block<3, 1>(k, m + 5) = v.p.template block<3, 1>(k, m + 5);
      given.template block<2, 3>(k + 3, m) = turn_before[c] * v.p.template block<1, 3>(k + 5, m);
      given.template block<2, 2>(k + 3, m + 3) =
          (v.p(k + 5, m + 5) * turn_before[c]) * turn_before[d].transpose();
      given.template block<2, 1>(k + 3, m + 5) = v.p(k + 5, m + 5) * turn_before[c];
      given.template block<1, 3>(k + 5, m) = v.p.template block<1, 3>(k + 5, m);
      given.template block<1, 2>(k + 5, m + 3) = v.p(k + 5, m + 5) * turn_before[d].transpose();
      given(k + 5, m + 5) = v.p(k + 5, m + 5);
    }
  }

  // Each curve by itself: its loads, its joint, the damping weight.
  const int n = state.segments();
  for (int c = 0; c < kCurves; ++c) {
    const int k = kCurve * c;
    const Expansion& one = *of[c];
    const Frame& frame = one.frames[at];
    const Vector3d& tangent = curve[c]->tangents()[at];
    double along = length * v.force_N.col(c).dot(tangent);  // (14)
    if (const int loaded = one.load_index[at]; loaded >= 0) {
      const LoadTerms& load = one.loads[static_cast<std::size_t>(loaded)];
      given.template block<3, 3>(k, k) += load.h0;
      with.template block<2, 3>(2 * c, k) += frame.transpose() * load.h1;
      pivot.template block<2, 2>(2 * c, 2 * c) += frame.transpose() * load.h2 * frame;
      constant.template segment<2>(2 * c) += frame.transpose() * load.g1;
      own.template segment<3>(k) += load.g0;
      along += load.g1.dot(tangent);
      v.force_N.col(c) += load.g0;
    }
    const JointTerms& joint = one.joints[at];
    const double rigidity =
        c == 0 ? std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1))
               : one.softer_N_mm2[at];
    pivot.template block<2, 2>(2 * c, 2 * c) += joint.hessian_distal;
    pivot(2 * c, 2 * c) += weight * rigidity - along;
    pivot(2 * c + 1, 2 * c + 1) += weight * rigidity - along;
    with.template block<2, 2>(2 * c, k + 3) += joint.hessian_cross.transpose();
    given.template block<2, 2>(k + 3, k + 3) += joint.hessian_proximal;
    constant.template segment<2>(2 * c) += joint.gradient_distal;
    own.template segment<2>(k + 3) += joint.gradient_proximal;
    if (rest[c] == nullptr) continue;
    with.template block<2, 1>(2 * c, k + 5) += rest[c]->with_distal;
    given.template block<2, 1>(k + 3, k + 5) += rest[c]->with_proximal;
    given.template block<1, 2>(k + 5, k + 3) += rest[c]->with_proximal.transpose();
    given(k + 5, k + 5) += rest[c]->hessian;
  }

  // What holds them together.
  if constexpr (kCurves == 2) {
    const BetweenCurves::Terms& terms = expansion.between.terms[at];
    if (terms.any) {
      for (int c = 0; c < 2; ++c) {
        const int k = kCurve * c;
        constant.template segment<2>(2 * c) += terms.gradient.template segment<2>(5 * c + 3);
        own.template segment<3>(k) += terms.gradient.template segment<3>(5 * c);
        v.force_N.col(c) += terms.gradient.template segment<3>(5 * c);
        for (int d = 0; d < 2; ++d) {
          const int m = kCurve * d;
          given.template block<3, 3>(k, m) += terms.hessian.template block<3, 3>(5 * c, 5 * d);
          with.template block<2, 3>(2 * c, m) +=
              terms.hessian.template block<2, 3>(5 * c + 3, 5 * d);
          pivot.template block<2, 2>(2 * c, 2 * d) +=
              terms.hessian.template block<2, 2>(5 * c + 3, 5 * d + 3);
        }
      }
    }
  }

  const Eigen::LLT<Matrix<double, kControl, kControl>> solver(pivot);
  // Relative, so that a pivot that is zero but for rounding does not pass.
  const auto diagonal = solver.matrixLLT().diagonal();
  if (solver.info() != Eigen::Success ||
      !(diagonal.minCoeff() > 1e-6 * diagonal.maxCoeff() && diagonal.maxCoeff() > 0)) {
    return false;
  }
  // Row by row, over all columns: Eigen's own solver and product take three times as long.
  const auto& l = solver.matrixLLT();
  Matrix<double, kControl, kGiven, Eigen::RowMajor> of_given = with;
  Matrix<double, kControl, 1> of_nothing = constant;
  for (int r = 0; r < kControl; ++r) {
    for (int k = 0; k < r; ++k) {
      of_given.row(r) -= l(r, k) * of_given.row(k);
      of_nothing[r] -= l(r, k) * of_nothing[k];
    }
    of_given.row(r) /= l(r, r);
    of_nothing[r] /= l(r, r);
  }
  for (int r = kControl - 1; r >= 0; --r) {
    for (int k = r + 1; k < kControl; ++k) {
      of_given.row(r) -= l(k, r) * of_given.row(k);
      of_nothing[r] -= l(k, r) * of_nothing[k];
    }
    of_given.row(r) /= l(r, r);
    of_nothing[r] /= l(r, r);
  }
  Gain& gain = gains_[at];
  gain.of_given.template topLeftCorner<kControl, kGiven>() = of_given;
  gain.constant.template head<kControl>() = of_nothing;
  v.p = given - with.transpose().lazyProduct(of_given);
  v.g = own - with.transpose().lazyProduct(of_nothing);
  v.decrease += 0.5 * constant.dot(of_nothing);
  return true;
}

bool TwoCurveSweep::SweepBoth(const WireModel& model, const WireState& state,
                              const Expansion& expansion, double weight, int first, CostToGo<2> v) {
  for (int i = first; i >= 0; --i) {
    if (!Stage<2>(model, state, expansion, weight, i, v)) return false;
    if (i % kSpacing == 0) checkpoints_[static_cast<std::size_t>(i / kSpacing)] = v;
  }
  predicted_decrease_ = v.decrease;
  return true;
}

bool TwoCurveSweep::Factor(const WireModel& model, const WireState& state,
                           const Expansion& expansion, double weight) {
  const int n = state.segments();
  const int both = state.second()->segments();
  gains_.resize(static_cast<std::size_t>(n));
  checkpoints_.resize(static_cast<std::size_t>(n / kSpacing) + 1);
  CostToGo<1> beyond;
  for (int i = n - 1; i >= both; --i) {
    if (!Stage<1>(model, state, expansion, weight, i, beyond)) return false;
  }
  CostToGo<2> v;
  v.p.topLeftCorner<kCurve, kCurve>() = beyond.p;
  v.g.head<kCurve>() = beyond.g;
  v.force_N.col(0) = beyond.force_N;
  v.decrease = beyond.decrease;
  return SweepBoth(model, state, expansion, weight, both - 1, v);
}

bool TwoCurveSweep::Refactor(const WireModel& model, const WireState& state,
                             const Expansion& expansion, double weight, int last_changed) {
  const int checkpoint = last_changed / kSpacing + 1;
  if (checkpoint * kSpacing >= state.second()->segments()) {
    return Factor(model, state, expansion, weight);
  }
  return SweepBoth(model, state, expansion, weight, checkpoint * kSpacing - 1,
                   checkpoints_[static_cast<std::size_t>(checkpoint)]);
}

double TwoCurveSweep::Step(const WireModel& model, const WireState& state,
                           const Expansion& expansion, std::vector<Vector2d>& step,
                           std::vector<double>& /*spin*/, std::vector<Vector3d>& displacement_mm) {
  const int n = state.segments();
  const int both = state.second()->segments();
  step.resize(static_cast<std::size_t>(n));
  displacement_mm.resize(static_cast<std::size_t>(n));
  second_step_.resize(static_cast<std::size_t>(both));
  second_displacement_mm_.resize(static_cast<std::size_t>(both));
  Matrix<double, 12, 1> given = Matrix<double, 12, 1>::Zero();
  const auto advance = [&](int i, int c, const Expansion& of, const Vector2d& control) {
    const auto at = static_cast<std::size_t>(i);
    const int k = kCurve * c;
    if (!of.turns.empty()) {
      given[k + 5] +=
          of.turns[at].proximal.dot(given.segment<2>(k + 3)) + of.turns[at].distal.dot(control);
    }
    given.segment<3>(k) += state.SegmentLength(model, i) * (of.frames[at] * control);
    given.segment<2>(k + 3) = control;
  };
  for (int i = 0; i < n; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const Gain& gain = gains_[at];
    displacement_mm[at] = given.head<3>();
    if (i < both) {
      const Matrix<double, 4, 1> control = -(gain.constant + gain.of_given.lazyProduct(given));
      second_displacement_mm_[at] = given.segment<3>(kCurve);
      second_step_[at] = control.tail<2>();
      step[at] = control.head<2>();
      advance(i, 1, expansion.second.front(), second_step_[at]);
    } else {
      step[at] = -(gain.constant.head<2>() +
                   gain.of_given.topLeftCorner<2, kCurve>() * given.head<kCurve>());
    }
    advance(i, 0, expansion, step[at]);
  }
  return predicted_decrease_;
}

}  // namespace torquer
