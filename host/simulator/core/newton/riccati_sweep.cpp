#include "host/simulator/core/newton/riccati_sweep.h"

#include <algorithm>

namespace torquer {

using Eigen::Vector3d;

namespace {

// (p M) for a symmetric p given by its upper triangle, and a frame by its rows.
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

RiccatiSweep<BendStage>::RiccatiSweep(int max_segments) {
  const auto n = static_cast<std::size_t>(max_segments) + 1;
  gains_.reserve(n);
  checkpoints_.reserve(n / kSpacing + 1);
}

bool RiccatiSweep<BendStage>::Factor(const WireModel& model, const WireState& state,
                                     const Expansion& expansion, double proximal) {
  const auto n = state.tangents.size();
  gains_.resize(n);
  checkpoints_.resize(n / kSpacing + 1);
  return Sweep(model, state, expansion, proximal, state.segments() - 1, CostToGo{});
}

bool RiccatiSweep<BendStage>::Refactor(const WireModel& model, const WireState& state,
                                       const Expansion& expansion, double proximal,
                                       int last_changed) {
  const int checkpoint = last_changed / kSpacing + 1;
  if (checkpoint * kSpacing >= state.segments()) return Factor(model, state, expansion, proximal);
  return Sweep(model, state, expansion, proximal, checkpoint * kSpacing - 1,
               checkpoints_[static_cast<std::size_t>(checkpoint)]);
}

// In pairs rather than small matrices, which take three times as long; this loop is a third of an
// iteration.
bool RiccatiSweep<BendStage>::Sweep(const WireModel& model, const WireState& state,
                                    const Expansion& expansion, double proximal, int first,
                                    CostToGo v) {
  const int n = state.segments();
  for (int i = first; i >= 0; --i) {
    const JointTerms& joint = expansion.joints[i];
    const Pair length = Both(state.SegmentLength(model, i));
    const double* frame = expansion.frames[i].data();
    const Pair t[3] = {Load(frame), Load(frame + 2), Load(frame + 4)};
    const Vector3d& tangent = state.tangents[i];

    // Beyond node i + 1: dx_{i+1} = dx_i + length T xi - length |xi|^2/2 tangent. F couples dx and
    // xi; T'X is the pivot without what is known by its diagonal.
    Pair f[3];
    Pair x[3];
    Multiply(v.p, t, f);
    for (int a = 0; a < 3; ++a) {
      f[a] = length * f[a] + v.q[a];
      x[a] = length * (f[a] + v.q[a]);
    }
    Pair c = length * (t[0] * v.gx[0] + t[1] * v.gx[1] + t[2] * v.gx[2]) + v.g +
             Load(joint.gradient_distal.data());
    Pair along = length * (v.force[0] * Both(tangent[0]) + v.force[1] * Both(tangent[1]) +
                           v.force[2] * Both(tangent[2]));

    // Loads on the segment itself.
    const int at = expansion.load_index[i];
    if (at >= 0) {
      const LoadTerms& load = expansion.loads[at];
      Pair h[6];
      Pair ht[3];
      UpperTriangle(load.h1, h);
      Multiply(h, t, ht);
      for (int a = 0; a < 3; ++a) f[a] += ht[a];
      UpperTriangle(load.h2, h);
      Multiply(h, t, ht);
      for (int a = 0; a < 3; ++a) x[a] += ht[a];
      UpperTriangle(load.h0, h);
      for (int a = 0; a < 6; ++a) v.p[a] += h[a];
      for (int a = 0; a < 3; ++a) {
        const Pair g1 = Both(load.g1[a]);
        const Pair g0 = Both(load.g0[a]);
        c += t[a] * g1;
        along += g1 * Both(tangent[a]);
        v.gx[a] += g0;
        v.force[a] += g0;
      }
    }
    const double rigidity = std::min(model.rigidity_N_mm2(n - i), model.rigidity_N_mm2(n - i - 1));
    const Pair s = t[0] * x[0] + t[1] * x[1] + t[2] * x[2] + v.r +
                   Pair{joint.hessian_distal(0, 0), joint.hessian_distal(1, 1)} +
                   Both(proximal * rigidity) - along;
    const Pair cross =
        Both(0.5) * Summed(t[0] * Swapped(x[0]) + t[1] * Swapped(x[1]) + t[2] * Swapped(x[2])) +
        v.r_cross + Both(joint.hessian_distal(0, 1));

    const double product = s[0] * s[1];
    const double determinant = product - cross[0] * cross[0];
    // Relative, so that a pivot that is zero but for rounding does not pass.
    if (!(s[0] > 0) || !(determinant > 1e-12 * s[0] * s[0])) return false;
    const Pair scale = Both(1 / determinant);
    const Pair inverse = scale * Swapped(s);
    const Pair inverse_cross = -scale * cross;

    Gain& gain = gains_[i];
    const Pair m[2] = {Load(joint.hessian_cross.data()), Load(joint.hessian_cross.data() + 2)};
    const Pair l[2] = {inverse * m[0] + inverse_cross * Swapped(m[0]),
                       inverse * m[1] + inverse_cross * Swapped(m[1])};
    const Pair k = inverse * c + inverse_cross * Swapped(c);
    Pair g[3];
    for (int a = 0; a < 3; ++a) {
      g[a] = inverse * f[a] + inverse_cross * Swapped(f[a]);
      gain.of_displacement[a] = g[a];
      v.gx[a] -= Summed(f[a] * k);
      v.q[a] = -Sums(f[a] * l[0], f[a] * l[1]);
    }
    gain.of_previous[0] = l[0];
    gain.of_previous[1] = l[1];
    gain.constant = k;
    v.p[0] -= Summed(f[0] * g[0]);
    v.p[1] -= Summed(f[0] * g[1]);
    v.p[2] -= Summed(f[0] * g[2]);
    v.p[3] -= Summed(f[1] * g[1]);
    v.p[4] -= Summed(f[1] * g[2]);
    v.p[5] -= Summed(f[2] * g[2]);
    v.r = Pair{joint.hessian_proximal(0, 0), joint.hessian_proximal(1, 1)} -
          Sums(m[0] * l[0], m[1] * l[1]);
    v.r_cross = Both(joint.hessian_proximal(0, 1)) - Summed(m[0] * l[1]);
    v.g = Load(joint.gradient_proximal.data()) - Sums(m[0] * k, m[1] * k);
    v.decrease += 0.5 * Summed(c * k)[0];
    if (i % kSpacing == 0) checkpoints_[static_cast<std::size_t>(i / kSpacing)] = v;
  }
  predicted_decrease_ = v.decrease;
  return true;
}

double RiccatiSweep<BendStage>::Step(const WireModel& model, const WireState& state,
                                     const Expansion& expansion, std::vector<Control>& step,
                                     std::vector<Vector3d>& displacement_mm) const {
  const int n = state.segments();
  step.resize(static_cast<std::size_t>(n));
  displacement_mm.resize(static_cast<std::size_t>(n));
  Pair xi = Both(0);
  Pair dx[3] = {Both(0), Both(0), Both(0)};
  for (int i = 0; i < n; ++i) {
    const Gain& gain = gains_[i];
    xi = -(gain.constant + gain.of_displacement[0] * dx[0] + gain.of_displacement[1] * dx[1] +
           gain.of_displacement[2] * dx[2] + gain.of_previous[0] * Firsts(xi, xi) +
           gain.of_previous[1] * Seconds(xi, xi));
    Store(xi, step[i].data());
    displacement_mm[i] = {dx[0][0], dx[1][0], dx[2][0]};
    const Pair turned = Both(state.SegmentLength(model, i)) * xi;
    const double* frame = expansion.frames[i].data();
    for (int a = 0; a < 3; ++a)
      dx[a] += Summed(Load(frame + static_cast<std::ptrdiff_t>(2 * a)) * turned);
  }
  return predicted_decrease_;
}

}  // namespace torquer
