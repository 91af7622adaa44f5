#include "host/simulator/core/newton/front_sweep.h"

#include <algorithm>
#include <cassert>
#include <cstring>
#include <type_traits>
#include <utility>

#include "host/simulator/core/stack/pair_order.h"

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

FrontSweep::FrontSweep(std::vector<const WireModel*> rods) : rods_(std::move(rods)) {
  const auto n = static_cast<std::size_t>(rods_.front()->max_segments()) + 1;
  const std::size_t curves = rods_.size();
  spin_rows_.fill(-1);
  for (std::size_t c = 0; c < curves; ++c) {
    slot_at_[c] = rows_;
    for (int m = 0; m < rods_[c]->spins(); ++m) {
      spin_rows_[static_cast<std::size_t>(rods_[c]->first_spin() + m)] = rows_ + 5 + m;
    }
    rows_ += SlotRows(rods_[c]->spins());
    inputs_[c].model = rods_[c];
    gains_.emplace_back().reserve(n);
    of_segments_.emplace_back().reserve(n);
  }
  of_groups_.resize(curves * (curves - 1) / 2);
  left_.resize(of_groups_.size());
  for (std::vector<int>& groups : of_groups_) groups.reserve(2 * n);
  const std::size_t operations = n * (curves + 2 * of_groups_.size());
  operations_.reserve(operations);
  checkpoints_.reserve(operations / kSpacing + 1);
}

FrontSegment FrontSweep::Inputs::Segment(int i) const {
  const auto k = static_cast<std::size_t>(i);
  const int from_tip = curve->segments() - i;
  FrontSegment segment{.length_mm = curve->SegmentLength(*model, i),
                       .frame = at->frames[k],
                       .tangent = curve->tangents()[k],
                       .joint = at->joints[k]};
  if (const int load = at->load_index[k]; load >= 0) {
    segment.load = &at->loads[static_cast<std::size_t>(load)];
  }
  if (!at->turns.empty()) segment.turn = &at->turns[k];
  // The softer of its two joints determines the weight.
  segment.bend_weight_mJ =
      weight * std::min(model->rigidity_N_mm2(from_tip), model->rigidity_N_mm2(from_tip - 1));
  const int spins = model->spins();
  if (spins == 0) return segment;
  segment.spins = &at->stack[k];
  const WireModel::TwistingJoint& before = model->twisting_joint(from_tip);
  const WireModel::TwistingJoint& beyond = model->twisting_joint(from_tip - 1);
  const auto first = static_cast<std::size_t>(model->first_spin());
  for (std::size_t m = 0; m < static_cast<std::size_t>(spins); ++m) {
    const std::size_t spin = first + m;
    segment.spin_weight_mJ[m] = weight * std::min(before.of[spin].torsional_rigidity_N_mm2,
                                                  beyond.of[spin].torsional_rigidity_N_mm2);
  }
  return segment;
}

void FrontSweep::AdvanceTo(int curve, int cut, std::array<int, kMostInstruments>& cuts) {
  int& at = cuts[static_cast<std::size_t>(curve)];
  std::vector<int>& of = of_segments_[static_cast<std::size_t>(curve)];
  while (at > cut) {
    --at;
    of[static_cast<std::size_t>(at)] = static_cast<int>(operations_.size());
    operations_.push_back({curve, -1, at});
  }
}

// Finds the cut of each curve beyond which nothing touches it; one curve alone is in the front from
// its tip on.
void FrontSweep::FindCommon(const WireState& state, const QuadraticModel& quadratic) {
  for (int c = 0; c < state.curves(); ++c) {
    const int segments = state.curve(c).segments();
    of_segments_[static_cast<std::size_t>(c)].assign(static_cast<std::size_t>(segments), -1);
    common_[static_cast<std::size_t>(c)] = state.curves() == 1 ? segments : 0;
  }
  for (const BetweenCurves& between : quadratic.between) {
    if (between.groups.empty()) continue;
    const SegmentPair& last = between.groups.back();
    int& inner = common_[static_cast<std::size_t>(between.inner)];
    int& outer = common_[static_cast<std::size_t>(between.outer)];
    inner = std::max(inner, last.inner + 1);
    outer = std::max(outer, last.outer + 1);
  }
}

// Orders the operations: a contact comes when both of its curves are at the cuts behind its
// segments. Contacts of several pairs are merged so that no curve has to go back.
void FrontSweep::Schedule(const WireState& state, const QuadraticModel& quadratic) {
  operations_.clear();
  FindCommon(state, quadratic);
  const std::vector<BetweenCurves>& between = quadratic.between;
  for (std::size_t k = 0; k < between.size(); ++k) {
    of_groups_[k].resize(between[k].groups.size());
    left_[k] = static_cast<int>(between[k].groups.size());
  }
  std::array<int, kMostInstruments> cuts = common_;
  for (std::size_t k = NextPair(between, left_); k < between.size(); k = NextPair(between, left_)) {
    const auto group = static_cast<std::size_t>(--left_[k]);
    const SegmentPair& pair = between[k].groups[group];
    assert(cuts[static_cast<std::size_t>(between[k].inner)] > pair.inner &&
           cuts[static_cast<std::size_t>(between[k].outer)] > pair.outer);
    AdvanceTo(between[k].inner, pair.inner + 1, cuts);
    AdvanceTo(between[k].outer, pair.outer + 1, cuts);
    of_groups_[k][group] = static_cast<int>(operations_.size());
    operations_.push_back({-1, static_cast<int>(k), left_[k]});
  }
  for (int c = 0; c < state.curves(); ++c) AdvanceTo(c, 0, cuts);
  checkpoints_.resize(operations_.size() / kSpacing + 1);
}

// Sweeps the segments beyond all contacts.
template <int kSpins>
bool FrontSweep::SweepAlone(int curve, Front<SlotRows(kSpins)>& beyond) {
  const auto c = static_cast<std::size_t>(curve);
  for (int i = inputs_[c].curve->segments() - 1; i >= common_[c]; --i) {
    const auto k = static_cast<std::size_t>(i);
    if (!beyond.template Advance<0, 0, kSpins>(inputs_[c].Segment(i), gains_[c][k])) return false;
  }
  return true;
}

// `kSpins`: of each curve.
template <int... kSpins>
bool FrontSweep::SweepSlots(const QuadraticModel& quadratic, int first) {
  constexpr int kCurves = sizeof...(kSpins);
  constexpr std::array<int, kCurves> kSpinsOf = {kSpins...};
  constexpr auto kAt = [](int curve) {
    constexpr std::array<int, kCurves> kOf = {kSpins...};
    int at = 0;
    for (int c = 0; c < curve; ++c) at += SlotRows(kOf[static_cast<std::size_t>(c)]);
    return at;
  };
  using AnyFront = Front<kAt(kCurves)>;
  static_assert(std::is_trivially_copyable_v<AnyFront> && sizeof(AnyFront) <= sizeof(Checkpoint));
  AnyFront front;
  constexpr auto kEach = std::make_integer_sequence<int, kCurves>();
  const auto begin = [&]<int... c>(std::integer_sequence<int, c...> /*curves*/) {
    return ([&] {
      Front<SlotRows(kSpinsOf[c])> beyond;
      if (!SweepAlone<kSpinsOf[c]>(c, beyond)) return false;
      front.template Take<c, kAt(c)>(beyond);
      return true;
    }() && ...);
  };
  const auto advance = [&]<int... c>(std::integer_sequence<int, c...> /*curves*/, int curve,
                                     int segment) {
    const auto i = static_cast<std::size_t>(segment);
    bool definite = true;
    ((curve == c ? static_cast<void>(definite = front.template Advance<c, kAt(c), kSpinsOf[c]>(
                                         inputs_[c].Segment(segment), gains_[c][i]))
                 : static_cast<void>(0)),
     ...);
    return definite;
  };
  if (first > 0) {
    assert(first % kSpacing == 0);
    std::memcpy(&front, checkpoints_[static_cast<std::size_t>(first / kSpacing)].front,
                sizeof front);
  } else if (!begin(kEach)) {
    return false;
  }
  for (int k = first; k < static_cast<int>(operations_.size()); ++k) {
    if (k % kSpacing == 0) {
      std::memcpy(checkpoints_[static_cast<std::size_t>(k / kSpacing)].front, &front, sizeof front);
    }
    const Operation& operation = operations_[static_cast<std::size_t>(k)];
    if (operation.pair < 0) {
      if (!advance(kEach, operation.curve, operation.index)) return false;
      continue;
    }
    const BetweenCurves& between = quadratic.between[static_cast<std::size_t>(operation.pair)];
    const auto group = static_cast<std::size_t>(operation.index);
    const typename AnyFront::Slots slots{between.inner, between.outer,
                                         slot_at_[static_cast<std::size_t>(between.inner)],
                                         slot_at_[static_cast<std::size_t>(between.outer)]};
    if (between.terms[group].any) front.Touch(between.terms[group], slots);
    if (!between.spin_terms.empty() && between.spin_terms[group].any) {
      front.Touch(between.spin_terms[group], slots, spin_rows_);
    }
  }
  predicted_decrease_mJ_ = front.decrease_mJ;
  return true;
}

bool FrontSweep::Sweep(const WireState& state, const QuadraticModel& quadratic, double weight,
                       int first) {
  int key = 0;  // spins of the curves as decimal digits, after a 1
  for (int c = 0; c < state.curves(); ++c) {
    Inputs& inputs = inputs_[static_cast<std::size_t>(c)];
    inputs.curve = &state.curve(c);
    inputs.at = &quadratic.curve(c);
    inputs.weight = weight;
    key = 10 * (c == 0 ? 1 : key) + inputs.model->spins();
  }
  switch (key) {
    case 12:
      return SweepSlots<2>(quadratic, first);
    case 13:
      return SweepSlots<3>(quadratic, first);
    case 14:
      return SweepSlots<4>(quadratic, first);
    case 100:
      return SweepSlots<0, 0>(quadratic, first);
    case 1000:
      return SweepSlots<0, 0, 0>(quadratic, first);
    case 10000:
      return SweepSlots<0, 0, 0, 0>(quadratic, first);
    case 111:
      return SweepSlots<1, 1>(quadratic, first);
    case 112:
      return SweepSlots<1, 2>(quadratic, first);
    case 121:
      return SweepSlots<2, 1>(quadratic, first);
    case 122:
      return SweepSlots<2, 2>(quadratic, first);
    case 113:
      return SweepSlots<1, 3>(quadratic, first);
    case 131:
      return SweepSlots<3, 1>(quadratic, first);
    case 1111:
      return SweepSlots<1, 1, 1>(quadratic, first);
    case 1112:
      return SweepSlots<1, 1, 2>(quadratic, first);
    case 1121:
      return SweepSlots<1, 2, 1>(quadratic, first);
    case 1211:
      return SweepSlots<2, 1, 1>(quadratic, first);
    default:
      assert(key == 11111);
      return SweepSlots<1, 1, 1, 1>(quadratic, first);
  }
}

bool FrontSweep::Factor(const WireState& state, const QuadraticModel& quadratic, double weight) {
  for (int c = 0; c < state.curves(); ++c) {
    gains_[static_cast<std::size_t>(c)].resize(state.curve(c).tangents().size());
  }
  Schedule(state, quadratic);
  return Sweep(state, quadratic, weight, 0);
}

bool FrontSweep::Refactor(const WireState& state, const QuadraticModel& quadratic, double weight,
                          int first) {
  const int checkpoint = first / kSpacing * kSpacing;
  if (checkpoint <= 0) return Factor(state, quadratic, weight);
  return Sweep(state, quadratic, weight, checkpoint);
}

namespace {

// Output of a curve during the pass from the sheath: its slot, and the destinations of its steps.
struct Moved {
  double* slot;
  const WireModel& model;
  const Curve& curve;
  const CurveQuadraticModel& at;
  const std::vector<FrontGain>& gains;
  CurveStep& step;

  void Begin() const {
    const auto n = static_cast<std::size_t>(curve.segments());
    step.xi.resize(n);
    step.spin.resize(n * static_cast<std::size_t>(model.spins()));
    step.displacement_mm.resize(n);
  }

  // Moves the slot from cut i to cut i + 1. `slots`: the arguments of the gain; `rows`: their
  // number.
  void Advance(int i, const double* slots, int rows) const {
    const auto k = static_cast<std::size_t>(i);
    const int spins = model.spins();
    double control[kMostControls] = {};
    for (int c = 0; c < SlotControls(spins); ++c) {
      double sum = gains[k].constant[c];
      for (int r = 0; r < rows; ++r) sum += gains[k].of_slots[c][r] * slots[r];
      control[c] = -sum;
    }
    const Vector2d xi(control[0], control[1]);
    step.displacement_mm[k] = {slot[0], slot[1], slot[2]};
    step.xi[k] = xi;
    const Vector3d moved = curve.SegmentLength(model, i) * (at.frames[k] * xi);
    for (int d = 0; d < 3; ++d) slot[d] += moved[d];
    if (!at.turns.empty()) {
      slot[5] += at.turns[k].proximal.dot(Vector2d(slot[3], slot[4])) + at.turns[k].distal.dot(xi);
    }
    slot[3] = xi[0];
    slot[4] = xi[1];
    for (int m = 0; m < spins; ++m) {
      slot[5 + m] = control[2 + m];
      step.spin[k * static_cast<std::size_t>(spins) + static_cast<std::size_t>(m)] = control[2 + m];
    }
  }
};

}  // namespace

double FrontSweep::Step(const WireState& state, const QuadraticModel& quadratic,
                        std::vector<CurveStep>& steps) {
  double slots[kMostFrontRows] = {};
  const auto moved = [&](int curve) {
    const auto c = static_cast<std::size_t>(curve);
    return Moved{slots + slot_at_[c],    *rods_[c], state.curve(curve),
                 quadratic.curve(curve), gains_[c], steps[c]};
  };
  for (int c = 0; c < state.curves(); ++c) moved(c).Begin();
  // The order is opposite to that of the sweep.
  for (auto operation = operations_.rbegin(); operation != operations_.rend(); ++operation) {
    if (operation->pair < 0) moved(operation->curve).Advance(operation->index, slots, rows_);
  }
  for (int c = 0; c < state.curves(); ++c) {
    const Moved alone = moved(c);
    const int rows = SlotRows(rods_[static_cast<std::size_t>(c)]->spins());
    for (int i = common_[static_cast<std::size_t>(c)]; i < state.curve(c).segments(); ++i) {
      alone.Advance(i, alone.slot, rows);
    }
  }
  return predicted_decrease_mJ_;
}

}  // namespace torquer
