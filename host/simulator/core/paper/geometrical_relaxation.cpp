#include "host/simulator/core/paper/geometrical_relaxation.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cassert>
#include <cmath>

namespace torquer {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

// Unit segments and inverse lengths around node i: entry k is the paper's segment i - 1 + k.
struct Segments {
  Vector3d u[4];
  double inverse[4];

  explicit Segments(const Vector3d* around) {
    for (int k = 0; k < 4; ++k) {
      const Vector3d d = around[k + 1] - around[k];
      inverse[k] = 1 / d.norm();
      u[k] = inverse[k] * d;
    }
  }
  // 1 - kappa of the joint between entries k and k + 1, without cancellation.
  double OneMinusKappa(int k) const { return (u[k + 1] - u[k]).squaredNorm() / 2; }
};

// Two directions across x_{i+1} - x_{i-1} in which node i may move.
Eigen::Matrix<double, 3, 2> PlaneAcross(const Vector3d& chord) {
  Eigen::Index smallest = 0;
  chord.cwiseAbs().minCoeff(&smallest);
  Eigen::Matrix<double, 3, 2> plane;
  plane.col(0) = chord.cross(Vector3d::Unit(smallest)).normalized();
  plane.col(1) = chord.cross(plane.col(0)).normalized();
  return plane;
}

}  // namespace

double GeometricalEnergy(const Vector3d* around) {
  const Segments s(around);
  double psi = 0;
  for (int k = 0; k < 3; ++k) {
    // (22): (13 - 14 kappa + kappa^2) / 2 = (12 y + y^2) / 2 with y = 1 - kappa.
    const double y = s.OneMinusKappa(k);
    psi += (s.inverse[k] + s.inverse[k + 1]) * (12 * y + y * y) / 2;
  }
  return psi;
}

Vector3d GeometricalGradient(const Vector3d* around) {
  const Segments s(around);
  // (23b); entries 1 and 2 are segments i and i + 1, the only ones whose lengths change.
  const auto kappa = [&](int k) { return 1 - s.OneMinusKappa(k); };
  const Vector3d kappa_gradient[3] = {
      (s.u[0] - kappa(0) * s.u[1]) * s.inverse[1],
      (s.u[2] - kappa(1) * s.u[1]) * s.inverse[1] - (s.u[1] - kappa(1) * s.u[2]) * s.inverse[2],
      -(s.u[3] - kappa(2) * s.u[2]) * s.inverse[2]};
  const Vector3d inverse_gradient[4] = {Vector3d::Zero(), -s.inverse[1] * s.inverse[1] * s.u[1],
                                        s.inverse[2] * s.inverse[2] * s.u[2], Vector3d::Zero()};
  Vector3d gradient = Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    const double y = s.OneMinusKappa(k);
    gradient += (12 * y + y * y) / 2 * (inverse_gradient[k] + inverse_gradient[k + 1]) -
                (s.inverse[k] + s.inverse[k + 1]) * (6 + y) * kappa_gradient[k];
  }
  return gradient;
}

CubicSpline::CubicSpline(const Vector3d& x_mu, const Vector3d& tangent_mu, const Vector3d& x_nu,
                         const Vector3d& tangent_nu)
    : x_mu_(x_mu), x_nu_(x_nu) {
  const Vector3d chord = x_nu - x_mu;  // X of (29)
  const double length = chord.norm();
  const double cos_mu = tangent_mu.dot(chord) / length;
  const double cos_nu = tangent_nu.dot(chord) / length;
  // (29) grows without bound towards 90 degrees, so (30) would select the worst splines.
  constexpr double kSmallestCosine = 0.1;
  valid_ = length > 0 && cos_mu > kSmallestCosine && cos_nu > kSmallestCosine;
  alignment_ = (1 + cos_mu) * (1 + cos_mu) * (1 + cos_nu) * (1 + cos_nu);
  s_mu_ = length / cos_mu * tangent_mu - chord;
  s_nu_ = length / cos_nu * tangent_nu - chord;
}

Vector3d CubicSpline::At(double tau) const {
  return (1 - tau) * x_mu_ + tau * x_nu_ +
         tau * (1 - tau) * ((1 - tau) * s_mu_ - tau * s_nu_);  // (28)
}

namespace {

bool ConstantRigidity(const WireModel& model, int segments, int mu, int nu) {
  const double rigidity = model.rigidity_N_mm2(segments - mu);
  for (int k = mu + 1; k <= nu; ++k) {
    if (std::abs(model.rigidity_N_mm2(segments - k) - rigidity) > 1e-12 * rigidity) return false;
  }
  return true;
}

// Computes the merit of the interval and shrinks its ends. The merit is zero if the interval is
// unusable.
GeometricalInterval Judge(const WireState& state, int mu, int nu, double shrink) {
  const auto tangent = [&](int i) {
    return (state.tangents()[i - 1] + state.tangents()[i]).normalized().eval();
  };
  const CubicSpline spline(state.nodes()[mu], tangent(mu), state.nodes()[nu], tangent(nu));
  if (!spline.valid()) return {};
  const auto square = [&](int i) {
    const double tau = static_cast<double>(i - mu) / (nu - mu);
    return (state.nodes()[i] - spline.At(tau)).squaredNorm();
  };
  double sum = 0;
  for (int i = mu; i <= nu; ++i) sum += square(i);
  const double variance = sum / (nu - mu);                                         // (30)
  GeometricalInterval interval{mu, nu, spline.alignment() * std::sqrt(variance)};  // (31)
  const double small = shrink * shrink * variance;
  while (interval.mu + 1 < nu && square(interval.mu + 1) < small) ++interval.mu;
  while (interval.nu - 1 > interval.mu && square(interval.nu - 1) < small) --interval.nu;
  return interval;
}

}  // namespace

std::optional<GeometricalInterval> SelectInterval(const WireModel& model, const WireState& state,
                                                  const std::vector<char>& near_wall, int last,
                                                  const GeometricalSettings& settings) {
  const int n = state.segments();
  GeometricalInterval best;
  int mu = 0;  // last node near the wall; 0: none so far
  for (int i = 1; i <= last; ++i) {
    if (!near_wall[i]) continue;
    if (mu > 0 && i - mu >= settings.fewest_segments && ConstantRigidity(model, n, mu, i)) {
      const GeometricalInterval candidate = Judge(state, mu, i, settings.shrink);
      if (candidate.merit > best.merit && candidate.length() >= 2) best = candidate;
    }
    mu = i;
  }
  if (best.merit == 0) return std::nullopt;
  return best;
}

namespace {

// (26), (27): moves a point on the chord from curve[i - 1] to curve[i] to the arc over the chord.
Vector3d ToArc(const std::vector<Vector3d>& curve, int i, const Vector3d& point) {
  const Vector3d chord = curve[i] - curve[i - 1];
  const double length = chord.norm();
  const Vector3d u = chord / length;
  const Vector3d before = (curve[i - 1] - curve[i - 2]).normalized();
  const Vector3d after = (curve[i + 1] - curve[i]).normalized();
  const double bend = 2 - u.dot(before + after);
  const Vector3d v_before = before.cross(u);
  const Vector3d v_after = u.cross(after);
  if (!(bend > 0) || !(v_before.dot(v_after) > 0)) return point;  // straight, or an inflection
  const Vector3d direction = u.cross(v_before.normalized() + v_after.normalized());
  const double radius = length / std::sqrt(bend);
  const double from_middle = length / 2 - (curve[i] - point).norm();
  const double at_point = radius * radius - from_middle * from_middle;
  const double at_middle = radius * radius - length * length / 4;
  // A bend by more than 180 degrees over one chord has no such arc.
  if (!(at_point > 0) || !(at_middle > 0)) return point;
  return point + (std::sqrt(at_point) - std::sqrt(at_middle)) * direction.normalized();
}

}  // namespace

void SlidePoints(const std::vector<Vector3d>& curve, int mu, double lambda, bool second_order,
                 std::vector<Vector3d>& slid) {
  const int n = static_cast<int>(curve.size()) - 1;
  assert(mu >= 1 && mu < n);
  slid.assign(curve.begin(), curve.end());
  int i = mu + 1;
  for (int j = mu + 1; j <= n; ++j) {
    const Vector3d& before = slid[j - 1];
    while (i < n && (curve[i] - before).norm() < lambda) ++i;
    const Vector3d u = (curve[i] - curve[i - 1]).normalized();
    const Vector3d b = u.cross((curve[i - 1] - before).cross(u));  // (24)
    const double along = std::sqrt(std::max(0.0, lambda * lambda - b.squaredNorm()));
    Vector3d point = before + b + along * u;  // (25)
    const bool past_end = i == n && (curve[n] - before).norm() < lambda;
    if (second_order && i < n && !past_end) {
      point = ToArc(curve, i, point);
      point = before + lambda * (point - before).normalized();
    }
    slid[j] = point;
  }
}

GeometricalRelaxation::GeometricalRelaxation(const WireModel& model, const ClearanceField& field,
                                             const GeometricalSettings& settings)
    : model_(model), field_(field), settings_(settings) {
  const auto room = static_cast<std::size_t>(model.max_segments()) + 2;
  near_wall_.reserve(room);
  curve_.reserve(room);
  planes_.reserve(room);
  blend_.reserve(room);
  slid_.reserve(room);
}

void GeometricalRelaxation::CopyFrom(const GeometricalRelaxation& twin) {
  interval_ = twin.interval_;
  sweeps_left_ = twin.sweeps_left_;
  zeta_ = twin.zeta_;
  near_wall_ = twin.near_wall_;
  curve_ = twin.curve_;
  planes_ = twin.planes_;
}

bool GeometricalRelaxation::Begin(const WireState& state) {
  Interrupt();
  const int n = state.segments();
  // Excludes the tip and every joint that rests curved; (22) at nu - 1 uses segment nu + 1.
  const int last =
      std::min(n - 1, n - std::max(model_.tip_segments(), model_.first_straight_joint()));
  near_wall_.assign(n + 1, 0);
  for (int i = 1; i <= last; ++i) {
    near_wall_[i] =
        field_.Clearance(state.nodes()[i]) - model_.radius_mm(n - i) < settings_.near_wall_mm;
  }
  const auto interval = SelectInterval(model_, state, near_wall_, last, settings_);
  if (!interval) return false;
  interval_ = *interval;
  sweeps_left_ = interval_.length();
  curve_.assign(state.nodes().begin(), state.nodes().end());
  // Constant during the whole minimization, so that no segment can shrink to zero length.
  planes_.clear();
  for (int i = interval_.mu + 1; i < interval_.nu; ++i) {
    planes_.push_back(PlaneAcross(curve_[i + 1] - curve_[i - 1]));
  }
  return true;
}

void GeometricalRelaxation::Update(int i) {
  Vector3d around[5];
  std::copy_n(curve_.begin() + i - 2, 5, around);
  const Vector3d center = around[2];
  const Eigen::Matrix<double, 3, 2>& plane = planes_[i - interval_.mu - 1];
  const auto psi = [&](double y, double z) {
    around[2] = center + y * plane.col(0) + z * plane.col(1);
    return GeometricalEnergy(around);
  };
  const Vector2d gradient = plane.transpose() * GeometricalGradient(around);
  const double d = model_.segment_mm() / 1e4;  // (23a)
  const double here = psi(0, 0);
  Matrix2d hessian;
  hessian(0, 0) = (psi(d, 0) - 2 * here + psi(-d, 0)) / (d * d);
  hessian(1, 1) = (psi(0, d) - 2 * here + psi(0, -d)) / (d * d);
  hessian(0, 1) = (psi(d, d) - psi(d, -d) - psi(-d, d) + psi(-d, -d)) / (4 * d * d);
  hessian(1, 0) = hessian(0, 1);
  // Far from the minimum the Hessian may be indefinite; the paper leaves that case open. Psi must
  // not grow. So the step then follows the gradient, and a step that overshoots is halved.
  const double determinant = hessian.determinant();
  const double trace = hessian.trace();
  Vector2d step = determinant > 0 && trace > 0
                      ? Vector2d(-hessian.inverse() * gradient)  // (23)
                      : Vector2d(-gradient / std::max(std::abs(trace), hessian.norm()));
  const double longest = model_.segment_mm() / 2;
  const double size = step.norm();
  if (!(size < 1e300)) return;
  if (size > longest) step *= longest / size;
  for (int attempt = 0; attempt < 10; ++attempt, step /= 2) {
    if (psi(step[0], step[1]) <= here) {
      curve_[i] = around[2];
      return;
    }
  }
}

bool GeometricalRelaxation::Try(double zeta, const WireState& state) {
  const int n = state.segments();
  blend_.assign(state.nodes().begin(), state.nodes().end());
  for (int i = interval_.mu + 1; i < interval_.nu; ++i) {
    blend_[i] = zeta * curve_[i] + (1 - zeta) * state.nodes()[i];
    if (field_.Clearance(blend_[i]) < model_.radius_mm(n - i)) return false;
  }
  SlidePoints(blend_, interval_.mu, model_.segment_mm(), settings_.second_order_slide, slid_);
  return (slid_[n] - state.nodes()[n]).norm() < model_.segment_mm();
}

bool GeometricalRelaxation::Continue(int sweeps, WireState& state) {
  assert(active() && curve_.size() == state.nodes().size());
  for (; sweeps > 0 && sweeps_left_ > 0; --sweeps, --sweeps_left_) {
    for (int i = interval_.mu + 1; i < interval_.nu; ++i) Update(i);
  }
  if (sweeps_left_ > 0) return false;

  zeta_ = 1;
  if (!Try(1, state)) {
    // Bisection for the largest possible zeta, to a part in a thousand.
    double refused = 1;
    zeta_ = 0;
    for (int k = 0; k < 10; ++k) {
      const double middle = (zeta_ + refused) / 2;
      (Try(middle, state) ? zeta_ : refused) = middle;
    }
    if (zeta_ == 0 || !Try(zeta_, state)) {
      zeta_ = 0;
      return true;
    }
  }
  state.LayThrough(model_, slid_, interval_.mu);
  return true;
}

}  // namespace torquer
