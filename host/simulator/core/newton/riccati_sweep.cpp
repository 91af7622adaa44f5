#include "host/simulator/core/newton/riccati_sweep.h"

#include <algorithm>

namespace torquer {

using Eigen::Vector3d;

namespace {

// Product p M of a symmetric p, given by its upper triangle, and a frame, given by its rows.
inline void Multiply(const Pair (&p)[6], const Pair (&t)[3], Pair (&out)[3]) {
  out[0] = p[0] * t[0] + p[1] * t[1] + p[2] * t[2];
  out[1] = p[1] * t[0] + p[3] * t[1] + p[4] * t[2];
  out[2] = p[2] * t[0] + p[4] * t[1] + p[5] * t[2];
}

inline void UpperTriangle(const Eigen::Matrix3d& m, Pair (&out)[6]) {
  out[0] = Both(m(0, 0));
  out[1] = Both(m(0, 1));
  out[2] = Both(m(0, 2));
  out[3] = Both(m(1, 1));
  out[4] = Both(m(1, 2));
  out[5] = Both(m(2, 2));
}

}  // namespace

template <class Stage>
RiccatiSweep<Stage>::RiccatiSweep(int max_segments) {
  const auto n = static_cast<std::size_t>(max_segments) + 1;
  gains_.reserve(n);
  checkpoints_.reserve(n / kSpacing + 1);
}

template <class Stage>
bool RiccatiSweep<Stage>::Factor(const WireModel& model, const Curve& curve,
                                 const CurveQuadraticModel& quadratic, double weight) {
  const auto n = curve.tangents().size();
  gains_.resize(n);
  checkpoints_.resize(n / kSpacing + 1);
  return Sweep(model, curve, quadratic, weight, curve.segments() - 1, CostToGo{});
}

template <class Stage>
bool RiccatiSweep<Stage>::Refactor(const WireModel& model, const Curve& curve,
                                   const CurveQuadraticModel& quadratic, double weight,
                                   int last_changed) {
  const int checkpoint = last_changed / kSpacing + 1;
  if (checkpoint * kSpacing >= curve.segments()) return Factor(model, curve, quadratic, weight);
  return Sweep(model, curve, quadratic, weight, checkpoint * kSpacing - 1,
               checkpoints_[checkpoint]);
}

// Eliminates the spin. Its couplings: b with dx, xi, the step and the spin before.
template <class Stage>
bool RiccatiSweep<Stage>::EliminateSpin(const TwistTerms& twist, double weight, Pair length,
                                        const Pair (&t)[3], CostToGo& v, StageCost& w, Gain& gain) {
  if constexpr (Stage::kTwists) {
    const double pivot = v.spin_stiffness + twist.hessian_distal + weight;
    if (!(pivot > 0)) return false;
    const double inverse = 1 / pivot;
    const double gradient = v.spin_gradient + twist.gradient_distal;
    double* const dx = v.spin_with_displacement;
    const Pair xi = length * (t[0] * Both(dx[0]) + t[1] * Both(dx[1]) + t[2] * Both(dx[2])) +
                    v.spin_with_previous + Load(twist.distal_distal.data());
    for (int a = 0; a < 3; ++a) dx[a] += twist.distal_displacement[a];
    const Pair previous = Load(twist.distal_proximal.data());
    const double spin = twist.hessian_cross;

    gain.spin_constant = inverse * gradient;
    gain.spin_of_control = Both(inverse) * xi;
    gain.spin_of_previous = Both(inverse) * previous;
    gain.spin_of_spin = inverse * spin;
    for (int a = 0; a < 3; ++a) gain.spin_of_displacement[a] = inverse * dx[a];
    const double* const scaled = gain.spin_of_displacement;

    w.s -= xi * gain.spin_of_control;
    w.cross -= Both(xi[0] * gain.spin_of_control[1]);
    w.c -= Both(gradient) * gain.spin_of_control;
    w.m[0] -= Both(previous[0]) * gain.spin_of_control;
    w.m[1] -= Both(previous[1]) * gain.spin_of_control;
    w.r -= previous * gain.spin_of_previous;
    w.r_cross -= Both(previous[0] * gain.spin_of_previous[1]);
    w.g -= Both(gradient) * gain.spin_of_previous;
    w.with_spin = Load(twist.proximal_distal.data()) - Both(spin) * gain.spin_of_control;
    w.spin_with_previous =
        Load(twist.proximal_proximal.data()) - Both(spin) * gain.spin_of_previous;
    w.spin_stiffness = twist.hessian_proximal - spin * gain.spin_of_spin;
    w.spin_gradient = twist.gradient_proximal - spin * gain.spin_constant;
    int at = 0;
    for (int a = 0; a < 3; ++a) {
      w.f[a] -= Both(dx[a]) * gain.spin_of_control;
      w.q[a] = -(Both(dx[a]) * gain.spin_of_previous);
      w.spin_with_displacement[a] = -spin * scaled[a];
      v.gx[a] -= Both(gradient * scaled[a]);
      for (int b = a; b < 3; ++b, ++at) v.p[at] -= Both(dx[a] * scaled[b]);
    }
    v.decrease += 0.5 * gradient * gain.spin_constant;
  }
  return true;
}

// Substitutes the turn zeta_i of segment i in the cost beyond node i + 1. It is the turn of the
// segment before plus the turn by the steps of joint i (README (36)).
template <class Stage>
void RiccatiSweep<Stage>::SubstituteSpin(const TurnTerms& turn, Pair length, const Pair (&t)[3],
                                         const CostToGo& v, StageCost& w) {
  const double(&dx)[3] = v.spin_with_displacement;
  const Pair p = Load(turn.proximal.data());
  const Pair d = Load(turn.distal.data());
  const Pair stiffness = Both(v.spin_stiffness);
  const Pair gradient = Both(v.spin_gradient);
  const Pair xi = v.spin_with_previous +
                  length * (t[0] * Both(dx[0]) + t[1] * Both(dx[1]) + t[2] * Both(dx[2]));
  const Pair with_spin = xi + stiffness * d;
  const Pair previous = stiffness * p;
  w.s += xi * d + d * with_spin;
  w.cross += Both(xi[0] * d[1] + d[0] * with_spin[1]);
  w.c += gradient * d;
  w.m[0] += Firsts(p, p) * with_spin;
  w.m[1] += Seconds(p, p) * with_spin;
  w.r += p * previous;
  w.r_cross += Both(p[0] * previous[1]);
  w.g += gradient * p;
  for (int a = 0; a < 3; ++a) {
    w.f[a] += Both(dx[a]) * d;
    w.q[a] = Both(dx[a]) * p;
    w.spin_with_displacement[a] = dx[a];
  }
  w.with_spin = with_spin + Load(turn.rest.with_distal.data());
  w.spin_with_previous = previous + Load(turn.rest.with_proximal.data());
  w.spin_stiffness = v.spin_stiffness + turn.rest.hessian;
  w.spin_gradient = v.spin_gradient;  // the joint's own part is in the gradients of the steps
}

// Assembles the cost of a stage as a function of its state (dx, xi before) and control. It adds the
// cost beyond, the loads and the joint. It uses pairs because small matrices take three times as
// long. The sweep is a third of an iteration.
template <class Stage>
void RiccatiSweep<Stage>::Assemble(const WireModel& model, const Curve& curve,
                                   const CurveQuadraticModel& quadratic, double weight, int i,
                                   Pair length, const Pair (&t)[3], CostToGo& v, StageCost& w) {
  const JointTerms& joint = quadratic.joints[i];
  const Vector3d& tangent = curve.tangents()[i];

  // Cost beyond node i + 1, by (15) and the third term of (4). T'X is the pivot except for the
  // terms known by their diagonal.
  Pair x[3];
  Multiply(v.p, t, w.f);
  for (int a = 0; a < 3; ++a) {
    w.f[a] = length * w.f[a] + v.q[a];  // (18)
    x[a] = length * (w.f[a] + v.q[a]);
  }
  w.c = length * (t[0] * v.gx[0] + t[1] * v.gx[1] + t[2] * v.gx[2]) + v.g +
        Load(joint.gradient_distal.data());  // (19)
  Pair along = length * (v.force[0] * Both(tangent[0]) + v.force[1] * Both(tangent[1]) +
                         v.force[2] * Both(tangent[2]));  // (14)

  // Loads on the segment itself.
  const int at = quadratic.load_index[i];
  if (at >= 0) {
    const LoadTerms& load = quadratic.loads[at];
    Pair h[6];
    Pair ht[3];
    UpperTriangle(load.h1, h);
    Multiply(h, t, ht);
    for (int a = 0; a < 3; ++a) w.f[a] += ht[a];  // (18)
    UpperTriangle(load.h2, h);
    Multiply(h, t, ht);
    for (int a = 0; a < 3; ++a) x[a] += ht[a];  // (17)
    UpperTriangle(load.h0, h);
    for (int a = 0; a < 6; ++a) v.p[a] += h[a];  // (21)
    for (int a = 0; a < 3; ++a) {
      const Pair g1 = Both(load.g1[a]);
      const Pair g0 = Both(load.g0[a]);
      w.c += t[a] * g1;                              // (19)
      along += Both(load.f1[a]) * Both(tangent[a]);  // (14)
      v.gx[a] += g0;                                 // (22)
      v.force[a] += Both(load.f0[a]);
    }
  }
  // (17)
  const int n = curve.segments();
  const double rigidity = std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1));
  w.s = t[0] * x[0] + t[1] * x[1] + t[2] * x[2] + v.r +
        Pair{joint.hessian_distal(0, 0), joint.hessian_distal(1, 1)} + Both(weight * rigidity) -
        along;
  w.cross = Both(0.5) * Summed(t[0] * Swapped(x[0]) + t[1] * Swapped(x[1]) + t[2] * Swapped(x[2])) +
            v.r_cross + Both(joint.hessian_distal(0, 1));
  w.m[0] = Load(joint.hessian_cross.data());
  w.m[1] = Load(joint.hessian_cross.data() + 2);
  w.r = Pair{joint.hessian_proximal(0, 0), joint.hessian_proximal(1, 1)};
  w.r_cross = Both(joint.hessian_proximal(0, 1));
  w.g = Load(joint.gradient_proximal.data());
}

// Finds the optimal control (20) as a function of the stage's state: S^-1 times F', H_pd' and f.
// Returns false if the pivot S is not positive definite.
template <class Stage>
template <typename RiccatiSweep<Stage>::Spin kSpin>
bool RiccatiSweep<Stage>::Eliminate(const StageCost& w, Gain& gain) {
  const double product = w.s[0] * w.s[1];
  const double determinant = product - w.cross[0] * w.cross[0];
  // A relative test: it rejects a pivot that is zero up to rounding.
  if (!(w.s[0] > 0) || !(determinant > 1e-12 * w.s[0] * w.s[0])) return false;
  const Pair scale = Both(1 / determinant);
  const Pair inverse = scale * Swapped(w.s);
  const Pair inverse_cross = -scale * w.cross;
  const auto solve = [&](Pair b) { return inverse * b + inverse_cross * Swapped(b); };

  gain.of_previous[0] = solve(w.m[0]);
  gain.of_previous[1] = solve(w.m[1]);
  gain.constant = solve(w.c);
  for (int a = 0; a < 3; ++a) gain.of_displacement[a] = solve(w.f[a]);
  if constexpr (kSpin != Spin::kNone) gain.of_spin = solve(w.with_spin);
  return true;
}

// Minimum cost of the stage and all beyond: (21), (22), with the control (20) substituted.
template <class Stage>
template <typename RiccatiSweep<Stage>::Spin kSpin>
void RiccatiSweep<Stage>::Propagate(const StageCost& w, const Gain& gain, CostToGo& v) {
  const Pair k = gain.constant;
  const Pair(&l)[2] = gain.of_previous;
  const Pair(&g)[3] = gain.of_displacement;
  for (int a = 0; a < 3; ++a) {
    v.gx[a] -= Summed(w.f[a] * k);
    v.q[a] = -Sums(w.f[a] * l[0], w.f[a] * l[1]);
  }
  v.p[0] -= Summed(w.f[0] * g[0]);
  v.p[1] -= Summed(w.f[0] * g[1]);
  v.p[2] -= Summed(w.f[0] * g[2]);
  v.p[3] -= Summed(w.f[1] * g[1]);
  v.p[4] -= Summed(w.f[1] * g[2]);
  v.p[5] -= Summed(w.f[2] * g[2]);
  v.r = w.r - Sums(w.m[0] * l[0], w.m[1] * l[1]);
  v.r_cross = w.r_cross - Summed(w.m[0] * l[1]);
  v.g = w.g - Sums(w.m[0] * k, w.m[1] * k);
  v.decrease += 0.5 * Summed(w.c * k)[0];
  if constexpr (kSpin != Spin::kNone) {
    const Pair spin = gain.of_spin;
    for (int a = 0; a < 3; ++a) {
      v.q[a] += w.q[a];
      v.spin_with_displacement[a] = w.spin_with_displacement[a] - Summed(w.f[a] * spin)[0];
    }
    v.spin_with_previous = w.spin_with_previous - Sums(w.m[0] * spin, w.m[1] * spin);
    v.spin_stiffness = w.spin_stiffness - Summed(w.with_spin * spin)[0];
    v.spin_gradient = w.spin_gradient - Summed(w.with_spin * k)[0];
  }
}

template <class Stage>
bool RiccatiSweep<Stage>::Sweep(const WireModel& model, const Curve& curve,
                                const CurveQuadraticModel& quadratic, double weight, int first,
                                const CostToGo& cost) {
  if constexpr (Stage::kTwists) {
    return SweepWith<Spin::kFree>(model, curve, quadratic, weight, first, cost);
  } else if (quadratic.turns.empty()) {
    return SweepWith<Spin::kNone>(model, curve, quadratic, weight, first, cost);
  } else {
    return SweepWith<Spin::kFollows>(model, curve, quadratic, weight, first, cost);
  }
}

template <class Stage>
template <typename RiccatiSweep<Stage>::Spin kSpin>
bool RiccatiSweep<Stage>::SweepWith(const WireModel& model, const Curve& curve,
                                    const CurveQuadraticModel& quadratic, double weight, int first,
                                    CostToGo v) {
  for (int i = first; i >= 0; --i) {
    const double* const frame = quadratic.frames[i].data();
    const Pair length = Both(curve.SegmentLength(model, i));
    const Pair t[3] = {Load(frame), Load(frame + 2), Load(frame + 4)};
    Gain& gain = gains_[i];
    StageCost cost;
    Assemble(model, curve, quadratic, weight, i, length, t, v, cost);
    if constexpr (kSpin == Spin::kFree) {
      const int n = curve.segments();
      const double torsional = std::min(model.torsional_rigidity_N_mm2(n - i),
                                        model.torsional_rigidity_N_mm2(n - i - 1));
      if (!EliminateSpin(quadratic.twists[i], weight * torsional, length, t, v, cost, gain)) {
        return false;
      }
    }
    if constexpr (kSpin == Spin::kFollows) {
      SubstituteSpin(quadratic.turns[i], length, t, v, cost);
    }
    if (!Eliminate<kSpin>(cost, gain)) return false;
    Propagate<kSpin>(cost, gain, v);
    if (i % kSpacing == 0) checkpoints_[i / kSpacing] = v;
  }
  predicted_decrease_ = v.decrease;
  return true;
}

template <class Stage>
double RiccatiSweep<Stage>::Step(const WireModel& model, const Curve& curve,
                                 const CurveQuadraticModel& quadratic, std::vector<Control>& step,
                                 std::vector<double>& spin,
                                 std::vector<Vector3d>& displacement_mm) const {
  if constexpr (Stage::kTwists) {
    StepWith<Spin::kFree>(model, curve, quadratic, step, spin, displacement_mm);
  } else if (quadratic.turns.empty()) {
    StepWith<Spin::kNone>(model, curve, quadratic, step, spin, displacement_mm);
  } else {
    StepWith<Spin::kFollows>(model, curve, quadratic, step, spin, displacement_mm);
  }
  return predicted_decrease_;
}

template <class Stage>
template <typename RiccatiSweep<Stage>::Spin kSpin>
void RiccatiSweep<Stage>::StepWith(const WireModel& model, const Curve& curve,
                                   const CurveQuadraticModel& quadratic, std::vector<Control>& step,
                                   std::vector<double>& spin,
                                   std::vector<Vector3d>& displacement_mm) const {
  const int n = curve.segments();
  step.resize(n);
  displacement_mm.resize(n);
  if constexpr (kSpin == Spin::kFree) spin.resize(n);
  double zeta = 0;
  Pair xi = Both(0);
  Pair dx[3] = {Both(0), Both(0), Both(0)};
  for (int i = 0; i < n; ++i) {
    const Gain& gain = gains_[i];
    const Pair previous = xi;
    xi = -(gain.constant + gain.of_displacement[0] * dx[0] + gain.of_displacement[1] * dx[1] +
           gain.of_displacement[2] * dx[2] + gain.of_previous[0] * Firsts(xi, xi) +
           gain.of_previous[1] * Seconds(xi, xi));
    if constexpr (kSpin != Spin::kNone) xi -= gain.of_spin * Both(zeta);
    if constexpr (kSpin == Spin::kFree) {
      zeta = -(gain.spin_constant + gain.spin_of_displacement[0] * dx[0][0] +
               gain.spin_of_displacement[1] * dx[1][0] + gain.spin_of_displacement[2] * dx[2][0] +
               gain.spin_of_spin * zeta +
               Summed(gain.spin_of_control * xi + gain.spin_of_previous * previous)[0]);
      spin[i] = zeta;
    }
    if constexpr (kSpin == Spin::kFollows) {
      const TurnTerms& turn = quadratic.turns[i];
      zeta += Summed(Load(turn.proximal.data()) * previous + Load(turn.distal.data()) * xi)[0];
    }
    Store(xi, step[i].data());
    displacement_mm[i] = {dx[0][0], dx[1][0], dx[2][0]};
    const Pair turned = Both(curve.SegmentLength(model, i)) * xi;
    const double* frame = quadratic.frames[i].data();
    for (int a = 0; a < 3; ++a)
      dx[a] += Summed(Load(frame + static_cast<std::ptrdiff_t>(2 * a)) * turned);
  }
}

template class RiccatiSweep<BendStage>;
template class RiccatiSweep<TwistStage>;

}  // namespace torquer
