#include "host/simulator/core/newton/front_sweep.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstring>
#include <type_traits>
#include <utility>

namespace torquer {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

bool AnyCross(const std::vector<BetweenCurves>& between) {
  return std::any_of(between.begin(), between.end(),
                     [](const BetweenCurves& pair) { return !pair.ordered; });
}

bool AnyTwist(const std::vector<const WireModel*>& rods) {
  return std::any_of(rods.begin(), rods.end(),
                     [](const WireModel* rod) { return rod->spins() > 0; });
}

// Spins of each curve, first row of its slot, and behind these the number of all rows. GCC 14
// cannot compile local constants in the lambdas that use these.
template <int... kSpins>
struct Slots {
  static constexpr int kCurves = sizeof...(kSpins);
  static constexpr std::array<int, kCurves> kSpinsOf = {kSpins...};
  static constexpr std::array<int, kCurves + 1> kAt = [] {
    std::array<int, kCurves + 1> starts{};
    for (int c = 0; c < kCurves; ++c) starts[c + 1] = starts[c] + SlotRows(kSpinsOf[c]);
    return starts;
  }();
};

}  // namespace

FrontSweep::FrontSweep(std::vector<const WireModel*> rods,
                       const std::vector<BetweenCurves>& between)
    : rods_(std::move(rods)),
      open_(AnyCross(between), AnyTwist(rods_)),
      schedule_(static_cast<int>(rods_.size()),
                static_cast<std::size_t>(rods_.front()->max_segments()) + 1, between,
                open_.block_rows()) {
  const auto n = static_cast<std::size_t>(rods_.front()->max_segments()) + 1;
  const std::size_t curves = rods_.size();
  spin_rows_.fill(-1);
  int most_controls = 0;
  for (std::size_t c = 0; c < curves; ++c) {
    const WireModel& rod = *rods_[c];
    slot_at_[c] = rows_;
    for (int m = 0; m < rod.spins(); ++m) {
      spin_rows_[rod.first_spin() + m] = rows_ + 5 + m;
    }
    rows_ += SlotRows(rod.spins());
    controls_[c] = SlotControls(rod.spins());
    most_controls = std::max(most_controls, controls_[c]);
    inputs_[c].model = rods_[c];
    gains_.emplace_back().reserve(n);
    if (rod.twists()) twists_.reserve(n);
  }
  if (AnyCross(between)) {
    open_gains_.reserve(
        n * curves *
        static_cast<std::size_t>(most_controls * open_.block_rows() * kMostOpenBlocks));
  }
  checkpoints_.reserve(schedule_.operations().capacity() / kSpacing + 1);
}

FrontSegment FrontSweep::Inputs::Segment(int i) const {
  const int from_tip = curve->segments() - i;
  FrontSegment segment{.length_mm = curve->SegmentLength(*model, i),
                       .frame = at->frames[i],
                       .tangent = curve->tangents()[i],
                       .joint = at->joints[i]};
  if (const int load = at->load_index[i]; load >= 0) {
    segment.load = &at->loads[load];
  }
  if (!at->turns.empty()) segment.turn = &at->turns[i];
  // The softer of its two joints determines the weight.
  segment.bend_weight_mJ =
      weight * std::min(model->rigidity_N_mm2(from_tip), model->rigidity_N_mm2(from_tip - 1));
  const int count = model->spins();
  if (count == 0) return segment;
  segment.spins = &spins[i];
  if (model->twists()) {
    segment.spin_weight_mJ[0] = weight * std::min(model->torsional_rigidity_N_mm2(from_tip),
                                                  model->torsional_rigidity_N_mm2(from_tip - 1));
    return segment;
  }
  const WireModel::TwistingJoint& before = model->twisting_joint(from_tip);
  const WireModel::TwistingJoint& beyond = model->twisting_joint(from_tip - 1);
  const int first = model->first_spin();
  for (int m = 0; m < count; ++m) {
    const std::size_t spin = first + m;
    segment.spin_weight_mJ[m] = weight * std::min(before.of[spin].torsional_rigidity_N_mm2,
                                                  beyond.of[spin].torsional_rigidity_N_mm2);
  }
  return segment;
}

// Writes the twist of a lone wire as that of a stack of one.
void FrontSweep::TakeTwists(int curve) {
  Inputs& inputs = inputs_[curve];
  if (!inputs.model->twists()) {
    inputs.spins = inputs.at->stack.data();
    return;
  }
  twists_.resize(inputs.at->twists.size());
  for (std::size_t i = 0; i < twists_.size(); ++i) {
    const TwistTerms& from = inputs.at->twists[i];
    StackTerms& to = twists_[i];
    to.gradient_proximal[0] = from.gradient_proximal;
    to.gradient_distal[0] = from.gradient_distal;
    to.hessian_proximal(0, 0) = from.hessian_proximal;
    to.hessian_distal(0, 0) = from.hessian_distal;
    to.hessian_cross[0] = from.hessian_cross;
    to.proximal_proximal.row(0) = from.proximal_proximal.transpose();
    to.proximal_distal.row(0) = from.proximal_distal.transpose();
    to.distal_proximal.row(0) = from.distal_proximal.transpose();
    to.distal_distal.row(0) = from.distal_distal.transpose();
    to.distal_displacement.row(0) = from.distal_displacement.transpose();
  }
  inputs.spins = twists_.data();
}

// Sweeps the segments beyond all contacts.
template <int kSpins>
bool FrontSweep::SweepAlone(int curve, Front<SlotRows(kSpins)>& beyond) {
  for (int i = inputs_[curve].curve->segments() - 1; i >= schedule_.common(curve); --i) {
    if (!beyond.template Advance<0, 0, kSpins>(inputs_[curve].Segment(i), gains_[curve][i])) {
      return false;
    }
  }
  return true;
}

template <int kSlot, int kAt, int kSpins, int kRows>
bool FrontSweep::Advance(const FrontOperation& operation, Front<kRows>& front) {
  const FrontSegment segment = inputs_[kSlot].Segment(operation.index);
  FrontGain& gain = gains_[kSlot][operation.index];
  if (operation.open == 0) return front.template Advance<kSlot, kAt, kSpins>(segment, gain);
  open_.Substitute(segment, kSpins, kAt, operation.open);
  PivotInverse inverse;
  if (!front.template Advance<kSlot, kAt, kSpins>(segment, gain, &inverse)) return false;
  open_.Eliminate(gain, inverse, SlotControls(kSpins), kRows, operation.open,
                  &open_gains_[operation.gains_at]);
  return true;
}

// Adds the terms of an operation that does not advance a curve.
template <int kRows>
void FrontSweep::Add(const FrontOperation& operation, const QuadraticModel& quadratic,
                     Front<kRows>& front) {
  if (operation.kind == FrontOperation::Kind::kOpen) {
    return open_.Open(operation.block, operation.open);
  }
  if (operation.kind == FrontOperation::Kind::kClose) {
    return open_.Close(operation.block, operation.open, RowsOf(operation.curve, operation.surface),
                       front);
  }
  const BetweenCurves& between = quadratic.between[operation.pair];
  const int group = operation.index;
  const BetweenCurves::Terms& terms = between.terms[group];
  if (operation.kind == FrontOperation::Kind::kTouch) {
    const typename Front<kRows>::Slots slots{between.inner, between.outer, slot_at_[between.inner],
                                             slot_at_[between.outer]};
    if (terms.any) front.Touch(terms, slots);
    if (!between.spin_terms.empty() && between.spin_terms[group].any) {
      front.Touch(between.spin_terms[group], slots, spin_rows_);
    }
    return;
  }
  if (!terms.any) return;
  const BetweenCurves::SpinTerms* spins =
      between.spin_terms.empty() || !between.spin_terms[group].any ? nullptr
                                                                   : &between.spin_terms[group];
  const CrossingTerms crossing{terms, spins};
  const int surface = spins == nullptr ? -1 : spins->surface[operation.side];
  const SideRows own = RowsOf(operation.curve, surface);
  if (operation.kind == FrontOperation::Kind::kWait) {
    open_.Wait(crossing, operation.side, operation.block, operation.surface >= 0, own, front);
  } else {
    AddEnd(crossing, operation.side, own, front);
  }
}

// Rows of a curve's slot, with those of the spin of an instrument, or -1 without.
SideRows FrontSweep::RowsOf(int curve, int surface) const {
  return {.curve = curve, .at = slot_at_[curve], .spin = surface < 0 ? -1 : spin_rows_[surface]};
}

// `kSpins`: of each curve.
template <int... kSpins>
bool FrontSweep::SweepSlots(const QuadraticModel& quadratic, int first) {
  using Of = Slots<kSpins...>;
  using AnyFront = Front<Of::kAt[Of::kCurves]>;
  static_assert(std::is_trivially_copyable_v<AnyFront> && sizeof(AnyFront) <= sizeof(Checkpoint));
  AnyFront front;
  constexpr auto kEach = std::make_integer_sequence<int, Of::kCurves>();
  const auto begin = [&]<int... c>(std::integer_sequence<int, c...> /*curves*/) {
    return ([&] {
      Front<SlotRows(Of::kSpinsOf[c])> beyond;
      if (!SweepAlone<Of::kSpinsOf[c]>(c, beyond)) return false;
      front.template Take<c, Of::kAt[c]>(beyond);
      return true;
    }() && ...);
  };
  const auto advance = [&]<int... c>(std::integer_sequence<int, c...> /*curves*/,
                                     const FrontOperation& operation) {
    bool definite = true;
    ((operation.curve == c
          ? static_cast<void>(definite = Advance<c, Of::kAt[c], Of::kSpinsOf[c]>(operation, front))
          : static_cast<void>(0)),
     ...);
    return definite;
  };
  if (first > 0) {
    assert(first % kSpacing == 0);
    std::memcpy(&front, checkpoints_[first / kSpacing].front, sizeof front);
  } else if (!begin(kEach)) {
    return false;
  }
  const std::vector<FrontOperation>& operations = schedule_.operations();
  for (int k = first; k < static_cast<int>(operations.size()); ++k) {
    if (k % kSpacing == 0) {
      std::memcpy(checkpoints_[k / kSpacing].front, &front, sizeof front);
    }
    const FrontOperation& operation = operations[k];
    if (operation.kind != FrontOperation::Kind::kAdvance) {
      Add(operation, quadratic, front);
    } else if (!advance(kEach, operation)) {
      return false;
    }
  }
  predicted_decrease_mJ_ = front.decrease_mJ;
  return true;
}

bool FrontSweep::Sweep(const WireState& state, const QuadraticModel& quadratic, double weight,
                       int first) {
  int key = 0;  // spins of the curves as decimal digits, after a 1
  for (int c = 0; c < state.curves(); ++c) {
    Inputs& inputs = inputs_[c];
    inputs.curve = &state.curve(c);
    inputs.at = &quadratic.curve(c);
    inputs.weight = weight;
    TakeTwists(c);
    key = 10 * (c == 0 ? 1 : key) + inputs.model->spins();
  }
  switch (key) {
    case 10:
      return SweepSlots<0>(quadratic, first);
    case 11:
      return SweepSlots<1>(quadratic, first);
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
    gains_[c].resize(state.curve(c).tangents().size());
  }
  schedule_.Make(state, quadratic, controls_);
  open_gains_.resize(schedule_.gains());
  checkpoints_.resize(schedule_.operations().size() / kSpacing + 1);
  return Sweep(state, quadratic, weight, 0);
}

bool FrontSweep::Refactor(const WireState& state, const QuadraticModel& quadratic, double weight,
                          int first) {
  // Checkpoints have no open rows.
  int checkpoint = first / kSpacing;
  while (checkpoint > 0 && schedule_.IsOpenAt(checkpoint * kSpacing)) --checkpoint;
  if (checkpoint <= 0) return Factor(state, quadratic, weight);
  return Sweep(state, quadratic, weight, checkpoint * kSpacing);
}

namespace {

// Rows of the open blocks during the pass from the sheath, with the gains of one segment.
struct OpenArguments {
  const double* rows = nullptr;   // of all blocks
  const double* gains = nullptr;  // control by control, and block by block
  std::uint64_t open = 0;
  int block_rows = 0;

  double Sum(int control) const {
    double sum = 0;
    const double* gain =
        gains + static_cast<std::ptrdiff_t>(control) * block_rows * std::popcount(open);
    for (int b = 0; open >> b != 0; ++b) {
      if ((open >> b & 1) == 0) continue;
      for (int r = 0; r < block_rows; ++r) sum += *gain++ * rows[block_rows * b + r];
    }
    return sum;
  }
};

// Output of a curve during the pass from the sheath: its slot, and the destinations of its steps.
struct Moved {
  double* slot;
  const WireModel& model;
  const Curve& curve;
  const CurveQuadraticModel& at;
  const std::vector<FrontGain>& gains;
  CurveStep& step;

  void Begin() const {
    const int n = curve.segments();
    step.xi.resize(n);
    step.spin.resize(n * static_cast<std::size_t>(model.spins()));
    step.displacement_mm.resize(n);
  }

  // Moves the slot from cut i to cut i + 1. `slots`: the arguments of the gain; `rows`: their
  // number. `open`: the gains of the open rows.
  void Advance(int i, const double* slots, int rows, const OpenArguments& open) const {
    const int spins = model.spins();
    double control[kMostControls] = {};
    for (int c = 0; c < SlotControls(spins); ++c) {
      double sum = gains[i].constant[c];
      for (int r = 0; r < rows; ++r) sum += gains[i].of_slots[c][r] * slots[r];
      control[c] = -(sum + open.Sum(c));
    }
    const Vector2d xi(control[0], control[1]);
    step.displacement_mm[i] = {slot[0], slot[1], slot[2]};
    step.xi[i] = xi;
    const Vector3d moved = curve.SegmentLength(model, i) * (at.frames[i] * xi);
    for (int d = 0; d < 3; ++d) slot[d] += moved[d];
    if (!at.turns.empty()) {
      slot[5] += at.turns[i].proximal.dot(Vector2d(slot[3], slot[4])) + at.turns[i].distal.dot(xi);
    }
    slot[3] = xi[0];
    slot[4] = xi[1];
    for (int m = 0; m < spins; ++m) {
      slot[5 + m] = control[2 + m];
      step.spin[i * spins + m] = control[2 + m];
    }
  }
};

}  // namespace

double FrontSweep::Step(const WireState& state, const QuadraticModel& quadratic,
                        std::vector<CurveStep>& steps) {
  double slots[kMostFrontRows] = {};
  const auto moved = [&](int curve) {
    return Moved{slots + slot_at_[curve], *rods_[curve], state.curve(curve),
                 quadratic.curve(curve),  gains_[curve], steps[curve]};
  };
  for (int c = 0; c < state.curves(); ++c) moved(c).Begin();
  // The order is opposite to that of the sweep.
  const int block_rows = open_.block_rows();
  double rows[OpenRows::kMostBlockRows * kMostOpenBlocks] = {};
  const std::vector<FrontOperation>& operations = schedule_.operations();
  for (auto operation = operations.rbegin(); operation != operations.rend(); ++operation) {
    if (operation->kind == FrontOperation::Kind::kAdvance) {
      const OpenArguments open{rows, open_gains_.data() + operation->gains_at, operation->open,
                               block_rows};
      moved(operation->curve).Advance(operation->index, slots, rows_, open);
    } else if (operation->kind == FrontOperation::Kind::kClose) {
      const SideRows own = RowsOf(operation->curve, operation->surface);
      double* const to = rows + block_rows * operation->block;
      for (int r = 0; r < own.count(); ++r) to[r] = slots[own[r]];
    }
  }
  for (int c = 0; c < state.curves(); ++c) {
    const Moved alone = moved(c);
    const int own_rows = SlotRows(rods_[c]->spins());
    for (int i = schedule_.common(c); i < state.curve(c).segments(); ++i) {
      alone.Advance(i, alone.slot, own_rows, {});
    }
  }
  return predicted_decrease_mJ_;
}

}  // namespace torquer
