#include "host/simulator/core/newton/front_sweep.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <type_traits>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

FrontSweep::FrontSweep(int max_segments, const WireModel* second) : second_(second) {
  const auto n = static_cast<std::size_t>(max_segments) + 1;
  gains_[0].reserve(n);
  checkpoints_.reserve(n / kSpacing + 1);
  if (second == nullptr) return;
  gains_[1].reserve(n);
  second_step_.reserve(n);
  second_spin_.reserve(n * kMostInstruments);
  second_displacement_mm_.reserve(n);
}

FrontSegment FrontSweep::Curve::Segment(int i) const {
  const auto k = static_cast<std::size_t>(i);
  const int from_tip = state.segments() - i;
  FrontSegment segment{.length_mm = state.SegmentLength(model, i),
                       .frame = at.frames[k],
                       .tangent = state.tangents()[k],
                       .joint = at.joints[k]};
  if (const int load = at.load_index[k]; load >= 0) {
    segment.load = &at.loads[static_cast<std::size_t>(load)];
  }
  if (!at.turns.empty()) segment.turn = &at.turns[k];
  // The softer of its two joints determines the weight.
  segment.bend_weight_mJ =
      weight * std::min(model.rigidity_N_mm2(from_tip), model.rigidity_N_mm2(from_tip - 1));
  const int spins = model.spins();
  if (spins == 0) return segment;
  segment.spins = &at.stack[k];
  const WireModel::TwistingJoint& before = model.twisting_joint(from_tip);
  const WireModel::TwistingJoint& beyond = model.twisting_joint(from_tip - 1);
  const auto first = static_cast<std::size_t>(model.first_spin());
  for (std::size_t m = 0; m < static_cast<std::size_t>(spins); ++m) {
    const std::size_t spin = first + m;
    segment.spin_weight_mJ[m] = weight * std::min(before.of[spin].torsional_rigidity_N_mm2,
                                                  beyond.of[spin].torsional_rigidity_N_mm2);
  }
  return segment;
}

template <class AnyFront>
void FrontSweep::Keep(int segment, const AnyFront& front) {
  if (segment % kSpacing != 0) return;
  Checkpoint& to = checkpoints_[static_cast<std::size_t>(segment / kSpacing)];
  static_assert(std::is_trivially_copyable_v<AnyFront> && sizeof front <= sizeof to.front);
  std::memcpy(to.front, &front, sizeof front);
}

template <class AnyFront>
void FrontSweep::Restore(int segment, AnyFront& front) const {
  assert(segment % kSpacing == 0);
  const Checkpoint& from = checkpoints_[static_cast<std::size_t>(segment / kSpacing)];
  std::memcpy(&front, from.front, sizeof front);
}

template <int kSpins>
bool FrontSweep::SweepOne(const Curve& curve, int first) {
  Front<SlotRows(kSpins)> front;
  if (first + 1 < curve.state.segments()) Restore(first + 1, front);
  for (int i = first; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    if (!front.template Advance<0, kSpins>(curve.Segment(i), curve.gains[k])) return false;
    Keep(i, front);
  }
  predicted_decrease_mJ_ = front.decrease_mJ;
  return true;
}

// `one` has the first slot, `other` the second; `first_slot` is the slot of the first curve.
template <int kSpins, int kOtherSpins>
bool FrontSweep::SweepSlots(const Curve& one, const Curve& other, int first_slot,
                            const BetweenCurves& between, int first) {
  constexpr int kOther = SlotRows(kSpins);
  Front<SlotRows(kSpins) + SlotRows(kOtherSpins)> front;
  const int both = std::min(one.state.segments(), other.state.segments());
  std::array<int, kMostInstruments> rows;
  rows.fill(-1);
  for (int m = 0; m < kSpins; ++m)
    rows[static_cast<std::size_t>(one.model.first_spin() + m)] = 5 + m;
  for (int m = 0; m < kOtherSpins; ++m) {
    rows[static_cast<std::size_t>(other.model.first_spin() + m)] = kOther + 5 + m;
  }
  const auto alone = [&]<int kAt, int kOwnSpins>(const Curve& curve) {
    Front<SlotRows(kOwnSpins)> beyond;
    for (int i = curve.state.segments() - 1; i >= both; --i) {
      const auto k = static_cast<std::size_t>(i);
      if (!beyond.template Advance<0, kOwnSpins>(curve.Segment(i), curve.gains[k])) return false;
    }
    front.template Take<kAt>(beyond);
    return true;
  };
  if (first + 1 < both) {
    Restore(first + 1, front);
  } else {
    first = both - 1;
    const bool definite = first_slot == 0 ? alone.template operator()<0, kSpins>(one)
                                          : alone.template operator()<kOther, kOtherSpins>(other);
    if (!definite) return false;
  }
  for (int i = first; i >= 0; --i) {
    const auto k = static_cast<std::size_t>(i);
    if (between.terms[k].any) front.template Touch<kOther>(between.terms[k], first_slot);
    if (!between.spin_terms.empty() && between.spin_terms[k].any) {
      front.template Touch<kOther>(between.spin_terms[k], first_slot, rows);
    }
    if (!front.template Advance<0, kSpins>(one.Segment(i), one.gains[k]) ||
        !front.template Advance<kOther, kOtherSpins>(other.Segment(i), other.gains[k])) {
      return false;
    }
    Keep(i, front);
  }
  predicted_decrease_mJ_ = front.decrease_mJ;
  return true;
}

// The curve with fewer spins has the first slot.
bool FrontSweep::SweepCurves(const Curve& one, const Curve& second, const BetweenCurves& between,
                             int first) {
  const bool swap = one.model.spins() > second.model.spins();
  const Curve& a = swap ? second : one;
  const Curve& b = swap ? one : second;
  const int slot = swap ? 1 : 0;
  if (a.model.spins() == 0) return SweepSlots<0, 0>(a, b, slot, between, first);
  if (a.model.spins() == 2) return SweepSlots<2, 2>(a, b, slot, between, first);
  switch (b.model.spins()) {
    case 1:
      return SweepSlots<1, 1>(a, b, slot, between, first);
    case 2:
      return SweepSlots<1, 2>(a, b, slot, between, first);
    default:
      return SweepSlots<1, 3>(a, b, slot, between, first);
  }
}

bool FrontSweep::Sweep(const WireModel& model, const WireState& state, const Expansion& expansion,
                       double weight, int first) {
  const Curve curve{model, state, expansion, weight, gains_[0]};
  if (second_ != nullptr) {
    const Curve other{*second_, *state.second(), expansion.second.front(), weight, gains_[1]};
    return SweepCurves(curve, other, expansion.between, first);
  }
  switch (model.spins()) {
    case 2:
      return SweepOne<2>(curve, first);
    case 3:
      return SweepOne<3>(curve, first);
    default:
      return SweepOne<kMostInstruments>(curve, first);
  }
}

bool FrontSweep::Factor(const WireModel& model, const WireState& state, const Expansion& expansion,
                        double weight) {
  const auto n = state.tangents().size();
  gains_[0].resize(n);
  checkpoints_.resize(n / kSpacing + 1);
  if (second_ != nullptr) gains_[1].resize(state.second()->tangents().size());
  return Sweep(model, state, expansion, weight, state.segments() - 1);
}

bool FrontSweep::Refactor(const WireModel& model, const WireState& state,
                          const Expansion& expansion, double weight, int last_changed) {
  const int checkpoint = (last_changed / kSpacing + 1) * kSpacing;
  // No front is stored beyond the shorter curve.
  const int kept = second_ == nullptr ? state.segments() : state.second()->segments();
  if (checkpoint >= kept) return Factor(model, state, expansion, weight);
  return Sweep(model, state, expansion, weight, checkpoint - 1);
}

namespace {

// Output of a curve during the pass from the sheath: its slot, and the destinations of its steps.
struct Moved {
  double* slot;
  const WireModel& model;
  const WireState& state;
  const Expansion& at;
  const std::vector<FrontGain>& gains;
  std::vector<Vector2d>& step;
  std::vector<double>& spin;
  std::vector<Vector3d>& displacement_mm;

  void Begin() {
    const auto n = static_cast<std::size_t>(state.segments());
    step.resize(n);
    spin.resize(n * static_cast<std::size_t>(model.spins()));
    displacement_mm.resize(n);
  }

  // Moves the slot from cut i to cut i + 1. `slots`: the arguments of the gain; `rows`: their
  // number.
  void Advance(int i, const double* slots, int rows) {
    const auto k = static_cast<std::size_t>(i);
    const int spins = model.spins();
    double control[kMostControls] = {};
    for (int c = 0; c < SlotControls(spins); ++c) {
      double sum = gains[k].constant[c];
      for (int r = 0; r < rows; ++r) sum += gains[k].of_slots[c][r] * slots[r];
      control[c] = -sum;
    }
    const Vector2d xi(control[0], control[1]);
    displacement_mm[k] = {slot[0], slot[1], slot[2]};
    step[k] = xi;
    const Vector3d moved = state.SegmentLength(model, i) * (at.frames[k] * xi);
    for (int d = 0; d < 3; ++d) slot[d] += moved[d];
    if (!at.turns.empty()) {
      slot[5] += at.turns[k].proximal.dot(Vector2d(slot[3], slot[4])) + at.turns[k].distal.dot(xi);
    }
    slot[3] = xi[0];
    slot[4] = xi[1];
    for (int m = 0; m < spins; ++m) {
      slot[5 + m] = control[2 + m];
      spin[k * static_cast<std::size_t>(spins) + static_cast<std::size_t>(m)] = control[2 + m];
    }
  }
};

}  // namespace

double FrontSweep::Step(const WireModel& model, const WireState& state, const Expansion& expansion,
                        std::vector<Vector2d>& step, std::vector<double>& spin,
                        std::vector<Vector3d>& displacement_mm) {
  double slots[kMostFrontRows] = {};
  const int n = state.segments();
  const int rows = SlotRows(model.spins());
  const WireState* const other = second_ == nullptr ? nullptr : state.second();
  const int other_rows = other == nullptr ? 0 : SlotRows(second_->spins());
  const bool swapped = other != nullptr && model.spins() > second_->spins();
  Moved first{slots + (swapped ? other_rows : 0),
              model,
              state,
              expansion,
              gains_[0],
              step,
              spin,
              displacement_mm};
  first.Begin();
  if (other == nullptr) {
    for (int i = 0; i < n; ++i) first.Advance(i, slots, rows);
    return predicted_decrease_mJ_;
  }
  Moved second{slots + (swapped ? 0 : rows),
               *second_,
               *other,
               expansion.second.front(),
               gains_[1],
               second_step_,
               second_spin_,
               second_displacement_mm_};
  second.Begin();
  // The order is opposite to that of the sweep.
  Moved* const order[2] = {swapped ? &first : &second, swapped ? &second : &first};
  const int both = second.state.segments();
  for (int i = 0; i < both; ++i) {
    for (Moved* curve : order) curve->Advance(i, slots, rows + other_rows);
  }
  for (int i = both; i < n; ++i) first.Advance(i, first.slot, rows);
  return predicted_decrease_mJ_;
}

}  // namespace torquer
