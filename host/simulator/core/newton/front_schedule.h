// Front schedule: the order in which a front takes the segments of all curves and the contacts
// between them. It goes from the tips to the sheath (README, section 6).
//
//   contact in order     both curves are at the cuts of the contact at once: one operation, Touch
//   contact that crosses    one curve, or one part of a curve, is there first: its segment waits
//                        for the other one with a block of open rows (open_rows.h)
//
//   tip   ... Touch(waiting block) ... Advance ... Advance ... Close(block) ... Advance ...  sheath
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "host/simulator/core/instrument_pose.h"
#include "host/simulator/core/wire_mechanics.h"

namespace torquer {

/// Most blocks of open rows at once. Each is a segment that the front has not reached yet, in
/// contact with a segment that it has passed.
inline constexpr int kMostOpenBlocks = 48;

/// Operation of a front.
struct FrontOperation {
  enum class Kind : std::uint8_t {
    kAdvance,  ///< advances `curve` over segment `index`
    kTouch,    ///< adds group `index` of `pair`, with both curves at its cuts
    kOpen,     ///< begins block `block`
    kWait,     ///< adds group `index` of `pair` on `side`, with `block` for the other side
    kClose,    ///< `curve` is at the cut of the segment for which `block` stands
    kEnd,      ///< adds `side` of group `index` of `pair` alone: no block was free
  };
  Kind kind = Kind::kAdvance;
  int curve = -1;
  int side = 0;  ///< 0: inner curve, 1: outer curve
  int pair = -1;
  int index = -1;
  int block = -1;
  int surface = -1;          ///< instrument whose spin the block has; -1 without
  std::uint64_t open = 0;    ///< bit by block: those that are open, without `block`
  std::size_t gains_at = 0;  ///< during kAdvance: first of the gains of the open rows
};

/// Schedule for one quadratic model. No heap after construction.
class FrontSchedule {
 public:
  /// Room for `curves` curves of up to `segments` segments, with the pairs of `between`.
  /// `block_rows`: of each block.
  FrontSchedule(int curves, std::size_t segments, const std::vector<BetweenCurves>& between,
                int block_rows);

  /// Orders the operations. `controls`: unknowns of a segment of each curve.
  void Make(const WireState& state, const QuadraticModel& quadratic,
            const std::array<int, kMostInstruments>& controls);

  const std::vector<FrontOperation>& operations() const { return operations_; }
  /// Number of segments of a curve in the common front; the segments beyond have no contact.
  int common(int curve) const { return common_[curve]; }
  /// Number of the operation that eliminates a segment; -1 for segments beyond all contacts.
  int OperationOf(int curve, int segment) const { return of_segments_[curve][segment]; }
  /// Number of the first operation that depends on a group of QuadraticModel::between[pair] or on
  /// one before it. 0 for curves that cross: the order depends on the groups that act.
  int OperationOfGroup(int pair, int group) const { return of_groups_[pair][group]; }
  /// True if blocks are open before an operation.
  bool IsOpenAt(int operation) const {
    if (operation >= static_cast<int>(operations_.size())) return false;
    const FrontOperation& at = operations_[operation];
    return at.open != 0 || at.kind == FrontOperation::Kind::kClose;
  }
  /// Number of gains of open rows.
  std::size_t gains() const { return gains_; }

 private:
  // Segment of a group of curves that cross.
  struct Crossing {
    int segment;
    int other_curve;
    int other_segment;
    int pair;
    int group;
    int side;
    bool ends;  // its contact was divided into two ends
  };

  void FindCommon(const WireState& state, const QuadraticModel& quadratic);
  void FindCrossings(const QuadraticModel& quadratic);
  void AdvanceTo(int curve, int cut, const QuadraticModel& quadratic);
  void Cross(int curve, int segment, const QuadraticModel& quadratic);
  void CloseBlock(int curve, int segment);
  int BlockOf(int curve, int segment);
  int SurfaceOf(int block, const Crossing& crossing, const QuadraticModel& quadratic);
  void Divide(const Crossing& crossing);
  bool IsPassed(int curve, int segment) const { return cuts_[curve] <= segment; }
  FrontOperation& Add(FrontOperation::Kind kind, int curve);

  // Segment for which a block stands.
  struct Block {
    int curve = -1;
    int segment = -1;
    int surface = -1;  // as in FrontOperation
  };

  std::vector<FrontOperation> operations_;
  std::array<int, kMostInstruments> common_ = {};
  std::array<int, kMostInstruments> cuts_ = {};
  std::array<int, kMostInstruments> controls_ = {};
  std::array<Block, kMostOpenBlocks> blocks_ = {};
  std::uint64_t open_ = 0;
  std::size_t gains_ = 0;
  const int block_rows_;
  std::vector<std::vector<int>> of_segments_;     // by curve
  std::vector<std::vector<int>> of_groups_;       // by pair of curves
  std::vector<int> left_;                         // by pair: groups that are not ordered yet
  std::vector<std::vector<Crossing>> crossings_;  // by curve, ascending by segment
  std::vector<int> next_crossing_;                // by curve: number of those not passed
};

}  // namespace torquer
