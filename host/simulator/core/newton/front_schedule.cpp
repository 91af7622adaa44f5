#include "host/simulator/core/newton/front_schedule.h"

#include <algorithm>
#include <bit>
#include <cassert>

#include "host/simulator/core/stack/pair_order.h"

namespace torquer {

using Kind = FrontOperation::Kind;

FrontSchedule::FrontSchedule(int curves, std::size_t segments,
                             const std::vector<BetweenCurves>& between, int block_rows)
    : block_rows_(block_rows) {
  std::size_t operations = segments * static_cast<std::size_t>(curves);
  of_groups_.resize(between.size());
  left_.resize(between.size());
  std::size_t crossings = 0;
  for (std::size_t k = 0; k < between.size(); ++k) {
    const std::size_t groups = between[k].groups.capacity();
    of_groups_[k].reserve(groups);
    // A contact that crosses opens and closes a block, or has two ends.
    operations += between[k].ordered ? groups : 3 * groups;
    if (between[k].ordered) continue;
    crossings += groups;
  }
  operations_.reserve(operations);
  of_segments_.resize(curves);
  crossings_.resize(curves);
  next_crossing_.resize(curves);
  for (std::vector<int>& of : of_segments_) of.reserve(segments);
  for (std::vector<Crossing>& of : crossings_) of.reserve(2 * crossings);
}

FrontOperation& FrontSchedule::Add(Kind kind, int curve) {
  FrontOperation& operation = operations_.emplace_back();
  operation.kind = kind;
  operation.curve = curve;
  operation.open = open_;
  return operation;
}

// Finds the cut of each curve beyond which it has no contact. A lone curve is in the front from its
// tip on.
void FrontSchedule::FindCommon(const WireState& state, const QuadraticModel& quadratic) {
  for (int c = 0; c < state.curves(); ++c) {
    const int segments = state.curve(c).segments();
    of_segments_[c].assign(segments, -1);
    common_[c] = state.curves() == 1 ? segments : 0;
  }
  const auto reach = [this](int curve, int segment) {
    int& common = common_[curve];
    common = std::max(common, segment + 1);
  };
  for (const BetweenCurves& between : quadratic.between) {
    if (!between.ordered || between.groups.empty()) continue;
    reach(between.inner, between.groups.back().inner);
    reach(between.outer, between.groups.back().outer);
  }
  for (std::size_t c = 0; c < crossings_.size(); ++c) {
    if (!crossings_[c].empty()) reach(static_cast<int>(c), crossings_[c].back().segment);
  }
}

// Collects the groups of curves that cross and have terms. The others take no rows; one of them
// that begins to act changes the order.
void FrontSchedule::FindCrossings(const QuadraticModel& quadratic) {
  for (std::vector<Crossing>& of : crossings_) of.clear();
  for (std::size_t k = 0; k < quadratic.between.size(); ++k) {
    const BetweenCurves& between = quadratic.between[k];
    if (between.ordered) continue;
    for (std::size_t g = 0; g < between.groups.size(); ++g) {
      if (!between.terms[g].any) continue;
      const SegmentPair& on = between.groups[g];
      const auto pair = static_cast<int>(k);
      const auto group = static_cast<int>(g);
      crossings_[between.inner].push_back(
          {on.inner, between.outer, on.outer, pair, group, 0, false});
      crossings_[between.outer].push_back(
          {on.outer, between.inner, on.inner, pair, group, 1, false});
    }
  }
  for (std::size_t c = 0; c < crossings_.size(); ++c) {
    std::sort(crossings_[c].begin(), crossings_[c].end(), [](const Crossing& a, const Crossing& b) {
      if (a.segment != b.segment) return a.segment < b.segment;
      if (a.pair != b.pair) return a.pair < b.pair;
      return a.group != b.group ? a.group < b.group : a.side < b.side;
    });
    next_crossing_[c] = static_cast<int>(crossings_[c].size());
  }
}

// Block that stands for a segment; a free one if none does yet, or -1.
int FrontSchedule::BlockOf(int curve, int segment) {
  int free = -1;
  for (int b = kMostOpenBlocks - 1; b >= 0; --b) {
    if ((open_ >> b & 1) == 0) {
      free = b;
      continue;
    }
    const Block& block = blocks_[b];
    if (block.curve == curve && block.segment == segment) return b;
  }
  if (free < 0) return -1;
  blocks_[free] = {curve, segment};
  Add(Kind::kOpen, curve).block = free;
  open_ |= std::uint64_t{1} << free;
  return free;
}

void FrontSchedule::CloseBlock(int curve, int segment) {
  for (int b = 0; b < kMostOpenBlocks; ++b) {
    const Block& block = blocks_[b];
    if ((open_ >> b & 1) == 0 || block.curve != curve || block.segment != segment) continue;
    open_ &= ~(std::uint64_t{1} << b);
    FrontOperation& operation = Add(Kind::kClose, curve);
    operation.block = b;
    operation.surface = block.surface;
    return;
  }
}

// Instrument whose spin a contact couples with the spins and steps of a block's segment, or -1. A
// block has the spin of one surface.
int FrontSchedule::SurfaceOf(int block, const Crossing& crossing, const QuadraticModel& quadratic) {
  const BetweenCurves& between = quadratic.between[crossing.pair];
  const int group = crossing.group;
  if (between.spin_terms.empty() || !between.spin_terms[group].any) return -1;
  const int surface = between.spin_terms[group].surface[1 - crossing.side];
  int& of_block = blocks_[block].surface;
  if (of_block < 0) of_block = surface;
  return surface == of_block ? surface : -1;
}

// Marks the other end of a contact whose ends act alone.
void FrontSchedule::Divide(const Crossing& crossing) {
  for (Crossing& other : crossings_[crossing.other_curve]) {
    if (other.pair == crossing.pair && other.group == crossing.group &&
        other.side != crossing.side) {
      other.ends = true;
    }
  }
}

// Adds the contacts that cross at a segment which its curve is about to advance over.
void FrontSchedule::Cross(int curve, int segment, const QuadraticModel& quadratic) {
  CloseBlock(curve, segment);
  for (int& k = next_crossing_[curve]; k > 0; --k) {
    const Crossing& crossing = crossings_[curve][k - 1];
    if (crossing.segment != segment) return;
    if (!crossing.ends && IsPassed(crossing.other_curve, crossing.other_segment)) continue;
    const int block = crossing.ends ? -1 : BlockOf(crossing.other_curve, crossing.other_segment);
    FrontOperation& operation = Add(block < 0 ? Kind::kEnd : Kind::kWait, curve);
    operation.side = crossing.side;
    operation.pair = crossing.pair;
    operation.index = crossing.group;
    operation.block = block;
    if (block >= 0) operation.surface = SurfaceOf(block, crossing, quadratic);
    if (block < 0 && !crossing.ends) Divide(crossing);
  }
}

void FrontSchedule::AdvanceTo(int curve, int cut, const QuadraticModel& quadratic) {
  while (cuts_[curve] > cut) {
    const int segment = cuts_[curve] - 1;
    if (!crossings_[curve].empty()) Cross(curve, segment, quadratic);
    of_segments_[curve][segment] = static_cast<int>(operations_.size());
    FrontOperation& operation = Add(Kind::kAdvance, curve);
    operation.index = segment;
    operation.gains_at = gains_;
    if (open_ != 0) {
      gains_ += static_cast<std::size_t>(block_rows_ * controls_[curve] * std::popcount(open_));
    }
    --cuts_[curve];
  }
}

void FrontSchedule::Make(const WireState& state, const QuadraticModel& quadratic,
                         const std::array<int, kMostInstruments>& controls) {
  operations_.clear();
  controls_ = controls;
  open_ = gains_ = 0;
  const std::vector<BetweenCurves>& between = quadratic.between;
  FindCrossings(quadratic);
  FindCommon(state, quadratic);
  cuts_ = common_;
  for (std::size_t k = 0; k < between.size(); ++k) {
    of_groups_[k].assign(between[k].groups.size(), 0);
    left_[k] = between[k].ordered ? static_cast<int>(between[k].groups.size()) : 0;
  }
  for (std::size_t k = NextPair(between, left_); k < between.size(); k = NextPair(between, left_)) {
    const int group = --left_[k];
    const SegmentPair& pair = between[k].groups[group];
    assert(cuts_[between[k].inner] > pair.inner && cuts_[between[k].outer] > pair.outer);
    AdvanceTo(between[k].inner, pair.inner + 1, quadratic);
    AdvanceTo(between[k].outer, pair.outer + 1, quadratic);
    of_groups_[k][group] = static_cast<int>(operations_.size());
    FrontOperation& operation = Add(Kind::kTouch, -1);
    operation.pair = static_cast<int>(k);
    operation.index = left_[k];
  }
  for (int c = 0; c < state.curves(); ++c) AdvanceTo(c, 0, quadratic);
  assert(open_ == 0);
}

}  // namespace torquer
