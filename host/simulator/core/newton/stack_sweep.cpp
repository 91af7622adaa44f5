// The sweep of a stack that twists: the state of a stage has the spins of all instruments in the
// segment before, its control those of the segment itself. In small matrices, of the size that the
// number of instruments asks for.
#include <Eigen/Cholesky>

#include "host/simulator/core/newton/riccati_sweep.h"

namespace torquer {

using Eigen::Matrix;
using Eigen::Vector3d;
using StackSweep = RiccatiSweep<StackTwistStage>;

template <>
template <int kSpins>
bool StackSweep::SweepStack(const WireModel& model, const WireState& state,
                            const Expansion& expansion, double weight, int first,
                            const CostToGo& cost) {
  constexpr int kGiven = 5 + kSpins;    // dx, the step before, the spins before
  constexpr int kControl = 2 + kSpins;  // the step, the spins
  const int n = state.segments();
  Matrix<double, kGiven, kGiven> p = cost.p.topLeftCorner<kGiven, kGiven>();
  Matrix<double, kGiven, 1> g = cost.g.head<kGiven>();
  Vector3d force_N = cost.force_N;
  double decrease = cost.decrease;
  for (int i = first; i >= 0; --i) {
    const auto at = static_cast<std::size_t>(i);
    const Frame& frame = expansion.frames[at];
    const Vector3d& tangent = state.tangents()[at];
    const JointTerms& joint = expansion.joints[at];
    const StackTerms& stack = expansion.stack[at];
    const double length = state.SegmentLength(model, i);

    // What lies beyond, with the displacement dx + l T xi, the step and the spins of this stage.
    Matrix<double, kGiven, kControl> pb;
    pb.template leftCols<2>() =
        length * (p.template leftCols<3>() * frame) + p.template middleCols<2>(3);
    pb.template rightCols<kSpins>() = p.template rightCols<kSpins>();
    Matrix<double, kControl, kControl> pivot;
    pivot.template topRows<2>() =
        length * (frame.transpose() * pb.template topRows<3>()) + pb.template middleRows<2>(3);
    pivot.template bottomRows<kSpins>() = pb.template bottomRows<kSpins>();
    Matrix<double, kControl, kGiven> with = Matrix<double, kControl, kGiven>::Zero();
    with.template leftCols<3>() = pb.template topRows<3>().transpose();
    Matrix<double, kGiven, kGiven> given = Matrix<double, kGiven, kGiven>::Zero();
    given.template topLeftCorner<3, 3>() = p.template topLeftCorner<3, 3>();
    Matrix<double, kControl, 1> c;
    c.template head<2>() =
        length * (frame.transpose() * g.template head<3>()) + g.template segment<2>(3);
    c.template tail<kSpins>() = g.template tail<kSpins>();
    Matrix<double, kGiven, 1> own = Matrix<double, kGiven, 1>::Zero();
    own.template head<3>() = g.template head<3>();
    double along = length * force_N.dot(tangent);  // (14)

    // Loads on the segment itself.
    if (const int loaded = expansion.load_index[at]; loaded >= 0) {
      const LoadTerms& load = expansion.loads[static_cast<std::size_t>(loaded)];
      given.template topLeftCorner<3, 3>() += load.h0;
      with.template topLeftCorner<2, 3>() += frame.transpose() * load.h1;
      pivot.template topLeftCorner<2, 2>() += frame.transpose() * load.h2 * frame;
      c.template head<2>() += frame.transpose() * load.g1;
      own.template head<3>() += load.g0;
      along += load.g1.dot(tangent);
      force_N += load.g0;
    }

    // The joint.
    const double rigidity = std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1));
    pivot.template topLeftCorner<2, 2>() += joint.hessian_distal;
    pivot(0, 0) += weight * rigidity - along;
    pivot(1, 1) += weight * rigidity - along;
    with.template block<2, 2>(0, 3) += joint.hessian_cross.transpose();
    given.template block<2, 2>(3, 3) += joint.hessian_proximal;
    c.template head<2>() += joint.gradient_distal;
    own.template segment<2>(3) += joint.gradient_proximal;
    for (int k = 0; k < kSpins; ++k) {
      const auto instrument = static_cast<std::size_t>(k);
      const double torsional =
          std::min(model.twisting_joint(n - i).of[instrument].torsional_rigidity_N_mm2,
                   model.twisting_joint(n - i - 1).of[instrument].torsional_rigidity_N_mm2);
      const auto proximal_proximal = stack.proximal_proximal.row(k);
      pivot(2 + k, 2 + k) += weight * torsional;
      pivot.template block<1, 2>(2 + k, 0) += stack.distal_distal.row(k);
      pivot.template block<2, 1>(0, 2 + k) += stack.distal_distal.row(k).transpose();
      with.template block<1, 3>(2 + k, 0) += stack.distal_displacement.row(k);
      with.template block<1, 2>(2 + k, 3) += stack.distal_proximal.row(k);
      with(2 + k, 5 + k) += stack.hessian_cross[k];
      with.template block<2, 1>(0, 5 + k) += stack.proximal_distal.row(k).transpose();
      given.template block<1, 2>(5 + k, 3) += proximal_proximal;
      given.template block<2, 1>(3, 5 + k) += proximal_proximal.transpose();
      c[2 + k] += stack.gradient_distal[k];
      own[5 + k] += stack.gradient_proximal[k];
    }
    pivot.template bottomRightCorner<kSpins, kSpins>() +=
        stack.hessian_distal.template topLeftCorner<kSpins, kSpins>();
    given.template bottomRightCorner<kSpins, kSpins>() +=
        stack.hessian_proximal.template topLeftCorner<kSpins, kSpins>();

    const Eigen::LLT<Matrix<double, kControl, kControl>> factor(pivot);
    if (factor.info() != Eigen::Success) return false;
    for (int k = 0; k < kControl; ++k) {
      const double left = factor.matrixLLT()(k, k);
      // Relative, so that a pivot that is zero but for rounding does not pass.
      if (!(left * left > 1e-12 * pivot(k, k))) return false;
    }
    Gain& gain = gains_[at];
    const Matrix<double, kControl, kGiven> of_given = factor.solve(with);
    const Matrix<double, kControl, 1> constant = factor.solve(c);
    gain.of_given.topLeftCorner<kControl, kGiven>() = of_given;
    gain.constant.head<kControl>() = constant;
    p = given - with.transpose() * of_given;
    g = own - with.transpose() * constant;
    decrease += c.dot(constant) / 2;
    if (i % kSpacing == 0) {
      CostToGo& kept = checkpoints_[static_cast<std::size_t>(i / kSpacing)];
      kept.p.topLeftCorner<kGiven, kGiven>() = p;
      kept.g.head<kGiven>() = g;
      kept.force_N = force_N;
      kept.decrease = decrease;
    }
  }
  predicted_decrease_ = decrease;
  return true;
}

template <>
bool StackSweep::Sweep(const WireModel& model, const WireState& state, const Expansion& expansion,
                       double weight, int first, const CostToGo& cost) {
  switch (model.spins()) {
    case 2:
      return SweepStack<2>(model, state, expansion, weight, first, cost);
    case 3:
      return SweepStack<3>(model, state, expansion, weight, first, cost);
    default:
      return SweepStack<kMostInstruments>(model, state, expansion, weight, first, cost);
  }
}

template <>
double StackSweep::Step(const WireModel& model, const WireState& state, const Expansion& expansion,
                        std::vector<Control>& step, std::vector<double>& spin,
                        std::vector<Vector3d>& displacement_mm) const {
  const auto n = state.tangents().size();
  const int spins = model.spins();
  step.resize(n);
  displacement_mm.resize(n);
  spin.resize(n * static_cast<std::size_t>(spins));
  Matrix<double, kMostGiven, 1> given = Matrix<double, kMostGiven, 1>::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const Gain& gain = gains_[i];
    const Matrix<double, kMostControl, 1> control =
        -(gain.constant + gain.of_given.lazyProduct(given));
    displacement_mm[i] = given.head<3>();
    step[i] = control.head<2>();
    for (int k = 0; k < spins; ++k) {
      spin[i * static_cast<std::size_t>(spins) + static_cast<std::size_t>(k)] = control[2 + k];
    }
    given.head<3>() +=
        state.SegmentLength(model, static_cast<int>(i)) * (expansion.frames[i] * control.head<2>());
    given.tail<kMostControl>() = control;
  }
  return predicted_decrease_;
}

}  // namespace torquer
