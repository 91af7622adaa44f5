#include "host/simulator/core/newton/active_set.h"

#include <algorithm>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

SpringSet::SpringSet(std::size_t most_springs) {
  active_.reserve(most_springs);
  solution_mm_.reserve(most_springs);
  stiffness_N_mm_.reserve(most_springs);
  rest_mm_.reserve(most_springs);
  best_mm_.reserve(most_springs);
}

template <class Spring>
void SpringSet::Reset(const std::vector<Spring>& springs) {
  active_.resize(springs.size());
  solution_mm_.resize(springs.size());
  stiffness_N_mm_.clear();
  rest_mm_.clear();
  for (const Spring& spring : springs) {
    stiffness_N_mm_.push_back(spring.stiffness_N_mm);
    rest_mm_.push_back(spring.penetration_mm);
  }
  best_mm_ = rest_mm_;
}

template <class Penetration>
double SpringSet::Excess(Penetration penetration_mm) const {
  double sum = 0;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const double at_mm = penetration_mm(k);
    if ((at_mm > 0) == (active_[k] != 0)) continue;
    const double energy = stiffness_N_mm_[k] * at_mm * at_mm / 2;  // (12)
    sum += active_[k] ? energy : -energy;
  }
  return sum;
}

double SpringSet::ExcessAtRest() const {
  return Excess([this](std::size_t k) { return rest_mm_[k]; });
}

double SpringSet::ExcessAt(double fraction) const {
  return Excess([&](std::size_t k) { return PenetrationAt(k, fraction); });
}

double SpringSet::ExcessSlopeAt(double fraction) const {
  double sum = 0;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const double at_mm = PenetrationAt(k, fraction);
    if ((at_mm > 0) == (active_[k] != 0)) continue;
    const double slope = stiffness_N_mm_[k] * at_mm * (solution_mm_[k] - best_mm_[k]);
    sum += active_[k] ? slope : -slope;
  }
  return sum;
}

void SpringSet::MoveBest(double fraction) {
  for (std::size_t k = 0; k < active_.size(); ++k) best_mm_[k] = PenetrationAt(k, fraction);
}

int SpringSet::TakePressing() {
  int last = -1;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const std::uint8_t presses = best_mm_[k] > 0;
    if (presses == active_[k]) continue;
    active_[k] = presses;
    last = static_cast<int>(k);
  }
  return last;
}

ActiveSet::ActiveSet(std::size_t points) : SpringSet(points) { pressed_N_.assign(points, 0); }

void ActiveSet::RememberPressed(const CurveQuadraticModel& quadratic) {
  Forget();
  for (std::size_t k = 0; k < quadratic.springs.size(); ++k) {
    pressed_N_[quadratic.points.FromTip(quadratic.points.near[k])] =
        quadratic.springs[k].ContactForceN();
  }
}

void ActiveSet::Forget() { std::fill(pressed_N_.begin(), pressed_N_.end(), 0); }

void ActiveSet::Begin(bool moved, CurveQuadraticModel& quadratic) {
  Reset(quadratic.springs);
  for (std::size_t k = 0; k < active_.size(); ++k) {
    WallSpring& spring = quadratic.springs[k];
    const int q = quadratic.points.near[k];
    const double pressed_N =
        moved ? pressed_N_[quadratic.points.FromTip(q)] : spring.ContactForceN();
    if (spring.force_N != pressed_N) {
      spring.Press(pressed_N, quadratic.points.clearance[q]);
    }
    active_[k] = pressed_N > 0;
  }
}

void ActiveSet::Look(const Curve& curve, const CurveQuadraticModel& quadratic,
                     const CurveStep& step) {
  is_wrong_ = false;
  const int per_segment = quadratic.points.per_segment;
  const double lambda_mm = quadratic.points.spacing_mm * per_segment;
  for (std::size_t k = 0; k < quadratic.springs.size(); ++k) {
    const int q = quadratic.points.near[k];
    const int i = q / per_segment;
    const double length = i == 0 ? curve.first_segment_mm() : lambda_mm;
    const double t = length * (q % per_segment + 1) / per_segment;
    const Vector3d moved = step.displacement_mm[i] + quadratic.frames[i] * (t * step.xi[i]);
    solution_mm_[k] =
        quadratic.springs[k].penetration_mm - quadratic.points.clearance[q].gradient.dot(moved);
    if ((solution_mm_[k] > 0) != (active_[k] != 0)) is_wrong_ = true;
  }
}

int ActiveSet::Update(const CurveQuadraticModel& quadratic) {
  const int last = TakePressing();
  if (last < 0) return -1;
  return quadratic.points.near[last] / quadratic.points.per_segment;
}

void BetweenSet::Begin(const BetweenCurves& between) {
  Reset(between.springs);
  for (std::size_t k = 0; k < active_.size(); ++k) {
    active_[k] = between.springs[k].penetration_mm > 0;
  }
}

void BetweenSet::Look(const WireState& state, const WireMechanics& mechanics,
                      const QuadraticModel& quadratic, const BetweenCurves& between,
                      const std::vector<CurveStep>& steps) {
  is_wrong_ = false;
  const auto unknowns = [&](int curve, int segment) {
    const CurveStep& own = steps[curve];
    const double length_mm = state.curve(curve).SegmentLength(mechanics.model(curve), segment);
    Eigen::Matrix<double, 5, 1> moved;
    moved << own.displacement_mm[segment] +
                 quadratic.curve(curve).frames[segment] * (length_mm * own.xi[segment]),
        own.xi[segment];
    return moved;
  };
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const BetweenCurves::Spring& spring = between.springs[k];
    const SegmentPair& on = between.groups[spring.group];
    BetweenCurves::Vector moved;
    moved << unknowns(between.inner, on.inner), unknowns(between.outer, on.outer);
    solution_mm_[k] = spring.penetration_mm + spring.approach.dot(moved);
    if ((solution_mm_[k] > 0) != (active_[k] != 0)) is_wrong_ = true;
  }
}

int BetweenSet::Update(const BetweenCurves& between) {
  const int last = TakePressing();
  return last < 0 ? -1 : between.springs[last].group;
}

std::uint64_t ActiveSet::Hash(std::uint64_t seed) const {
  for (const double force_N : pressed_N_) seed = HashDouble(force_N, seed);
  return seed;
}

}  // namespace torquer
