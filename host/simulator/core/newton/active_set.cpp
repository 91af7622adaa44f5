#include "host/simulator/core/newton/active_set.h"

#include <algorithm>

#include "host/simulator/core/hash.h"

namespace torquer {

using Eigen::Vector3d;

ActiveSet::ActiveSet(std::size_t points) {
  active_.reserve(points);
  pressed_.assign(points, 0);
}

void ActiveSet::RememberPressed(const Expansion& expansion) {
  Forget();
  for (const int q : expansion.points.near) {
    pressed_[static_cast<std::size_t>(expansion.points.FromTip(q))] =
        expansion.points.touches[static_cast<std::size_t>(q)];
  }
}

void ActiveSet::Forget() { std::fill(pressed_.begin(), pressed_.end(), 0); }

void ActiveSet::Begin(const Expansion& expansion, bool moved) {
  active_.resize(expansion.springs.size());
  for (std::size_t k = 0; k < active_.size(); ++k) {
    active_[k] =
        moved
            ? pressed_[static_cast<std::size_t>(expansion.points.FromTip(expansion.points.near[k]))]
            : expansion.springs[k].penetration_mm > 0;
  }
}

template <class MovedBy>
int ActiveSet::UpdateBy(const WireState& state, const Expansion& expansion, MovedBy moved_by) {
  int last_changed = -1;
  const int per_segment = expansion.points.per_segment;
  const double lambda_mm = expansion.points.spacing_mm * per_segment;
  for (std::size_t k = 0; k < expansion.springs.size(); ++k) {
    const int q = expansion.points.near[k];
    const int i = q / per_segment;
    const double length = i == 0 ? state.first_segment_mm() : lambda_mm;
    const double t = length * (q % per_segment + 1) / per_segment;
    const Vector3d moved = moved_by(q, i, t);
    const double penetration =
        expansion.springs[k].penetration_mm -
        expansion.points.clearance[static_cast<std::size_t>(q)].gradient.dot(moved);
    const std::uint8_t presses = penetration > 0;
    if (presses == active_[k]) continue;
    active_[k] = presses;
    last_changed = i;
  }
  return last_changed;
}

int ActiveSet::Update(const WireState& state, const Expansion& expansion, const CurveStep& step) {
  return UpdateBy(state, expansion, [&](int /*q*/, int i, double t) -> Vector3d {
    return step.displacement_mm[i] + expansion.frames[i] * (t * step.xi[i]);
  });
}

int ActiveSet::Update(const WireState& state, const Expansion& expansion, const CurveStep& step,
                      const CurveStep& second) {
  return UpdateBy(state, expansion, [&](int q, int i, double t) -> Vector3d {
    const bool on_second = expansion.points.OnSecond(q);
    const CurveStep& own = on_second ? second : step;
    const Expansion& of = on_second ? expansion.second.front() : expansion;
    return own.displacement_mm[i] + of.frames[i] * (t * own.xi[i]);
  });
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

double ActiveSet::EnergyAtRest(const Expansion& expansion) const {
  return AtRest(expansion.springs, active_);
}

void BetweenSet::Begin(const BetweenCurves& between) {
  active_.resize(between.springs.size());
  for (std::size_t k = 0; k < active_.size(); ++k) {
    active_[k] = between.springs[k].penetration_mm > 0;
  }
}

int BetweenSet::Update(const WireState& state, const Expansion& expansion, const CurveStep& step,
                       const CurveStep& second) {
  const double lambda_mm = expansion.points.spacing_mm * expansion.points.per_segment;
  int last_changed = -1;
  for (std::size_t k = 0; k < active_.size(); ++k) {
    const BetweenCurves::Spring& spring = expansion.between.springs[k];
    const auto i = static_cast<std::size_t>(spring.segment);
    const double length_mm = i == 0 ? state.first_segment_mm() : lambda_mm;
    const auto node_beyond = [&](const Expansion& of, const CurveStep& own) -> Vector3d {
      return own.displacement_mm[i] + of.frames[i] * (length_mm * own.xi[i]);
    };
    BetweenCurves::Vector moved;
    moved << node_beyond(expansion, step), step.xi[i],
        node_beyond(expansion.second.front(), second), second.xi[i];
    const std::uint8_t presses = spring.penetration_mm + spring.approach.dot(moved) > 0;
    if (presses == active_[k]) continue;
    active_[k] = presses;
    last_changed = spring.segment;
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
