#include "host/simulator/core/newton/active_set.h"

#include <algorithm>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

ActiveSet::ActiveSet(std::size_t points) {
  active_.reserve(points);
  pressed_.assign(points, 0);
}

void ActiveSet::RememberPressed(const CurveQuadraticModel& quadratic) {
  Forget();
  for (const int q : quadratic.points.near) {
    pressed_[static_cast<std::size_t>(quadratic.points.FromTip(q))] =
        quadratic.points.touches[static_cast<std::size_t>(q)];
  }
}

void ActiveSet::Forget() { std::fill(pressed_.begin(), pressed_.end(), 0); }

void ActiveSet::Begin(const CurveQuadraticModel& quadratic, bool moved) {
  active_.resize(quadratic.springs.size());
  for (std::size_t k = 0; k < active_.size(); ++k) {
    active_[k] =
        moved
            ? pressed_[static_cast<std::size_t>(quadratic.points.FromTip(quadratic.points.near[k]))]
            : quadratic.springs[k].penetration_mm > 0;
  }
}

int ActiveSet::Update(const Curve& curve, const CurveQuadraticModel& quadratic,
                      const CurveStep& step) {
  int last_changed = -1;
  const int per_segment = quadratic.points.per_segment;
  const double lambda_mm = quadratic.points.spacing_mm * per_segment;
  for (std::size_t k = 0; k < quadratic.springs.size(); ++k) {
    const int q = quadratic.points.near[k];
    const int i = q / per_segment;
    const double length = i == 0 ? curve.first_segment_mm() : lambda_mm;
    const double t = length * (q % per_segment + 1) / per_segment;
    const Vector3d moved = step.displacement_mm[i] + quadratic.frames[i] * (t * step.xi[i]);
    const double penetration =
        quadratic.springs[k].penetration_mm -
        quadratic.points.clearance[static_cast<std::size_t>(q)].gradient.dot(moved);
    const std::uint8_t presses = penetration > 0;
    if (presses == active_[k]) continue;
    active_[k] = presses;
    last_changed = i;
  }
  return last_changed;
}

namespace {

template <class Spring>
double AtRest(const std::vector<Spring>& springs, const std::vector<std::uint8_t>& active) {
  double sum = 0;
  for (std::size_t k = 0; k < active.size(); ++k) {
    const Spring& spring = springs[k];
    const double energy =
        spring.stiffness_N_mm * spring.penetration_mm * spring.penetration_mm / 2;  // (12)
    if (active[k] && spring.penetration_mm <= 0) sum += energy;
    if (!active[k] && spring.penetration_mm > 0) sum -= energy;
  }
  return sum;
}

}  // namespace

double ActiveSet::EnergyAtRest(const CurveQuadraticModel& quadratic) const {
  return AtRest(quadratic.springs, active_);
}

void BetweenSet::Begin(const BetweenCurves& between) {
  active_.resize(between.springs.size());
  for (std::size_t k = 0; k < active_.size(); ++k) {
    active_[k] = between.springs[k].penetration_mm > 0;
  }
}

int BetweenSet::Update(const WireState& state, const WireMechanics& mechanics,
                       const QuadraticModel& quadratic, const BetweenCurves& between,
                       const std::vector<CurveStep>& steps) {
  int last_changed = -1;
  const auto unknowns = [&](int curve, int segment) {
    const auto i = static_cast<std::size_t>(segment);
    const CurveStep& own = steps[static_cast<std::size_t>(curve)];
    const double length_mm = state.curve(curve).SegmentLength(mechanics.model(curve), segment);
    Eigen::Matrix<double, 5, 1> moved;
    moved << own.displacement_mm[i] + quadratic.curve(curve).frames[i] * (length_mm * own.xi[i]),
        own.xi[i];
    return moved;
  };
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const BetweenCurves::Spring& spring = between.springs[k];
    const SegmentPair& on = between.groups[static_cast<std::size_t>(spring.group)];
    BetweenCurves::Vector moved;
    moved << unknowns(between.inner, on.inner), unknowns(between.outer, on.outer);
    const std::uint8_t presses = spring.penetration_mm + spring.approach.dot(moved) > 0;
    if (presses == active_[k]) continue;
    active_[k] = presses;
    last_changed = spring.group;
  }
  return last_changed;
}

double BetweenSet::EnergyAtRest(const BetweenCurves& between) const {
  return AtRest(between.springs, active_);
}

std::uint64_t ActiveSet::Hash(std::uint64_t seed) const {
  std::uint64_t word = 0;
  for (std::size_t k = 0; k < pressed_.size(); ++k) {
    word = word << 1 | pressed_[k];
    if (k % 64 == 63 || k + 1 == pressed_.size()) {
      seed = HashWord(word, seed);
      word = 0;
    }
  }
  return seed;
}

}  // namespace torquer
