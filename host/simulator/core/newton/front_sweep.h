// Newton step of instruments that twist, or lie on several curves, in O(n): one front for all of
// them (README, sections 6, 17 and 18).
//
//   inner    ====================|====================
//   outer    --------------------|                      within: an operation at a time, from the
//   mouth
//                in one front    |  the inner alone     to the sheath
//
// An operation advances one curve by one segment, or adds the contact of two segments.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/newton/front.h"

namespace torquer {

/// Sweep like RiccatiSweep, for all curves of a state.
class FrontSweep {
 public:
  /// `rods`: the model of each curve, which must outlive this.
  explicit FrontSweep(std::vector<const WireModel*> rods);

  /// Eliminates all segments. Returns false if a pivot is not positive definite. `weight`: proximal
  /// weight, in units of the local EI/(1 mm).
  bool Factor(const WireState& state, const QuadraticModel& quadratic, double weight);
  /// Like Factor, if since the last one only operations from number `first` on have other loads.
  bool Refactor(const WireState& state, const QuadraticModel& quadratic, double weight, int first);
  /// Steps of all curves. Returns the predicted decrease of the energy, mJ.
  double Step(const WireState& state, const QuadraticModel& quadratic,
              std::vector<CurveStep>& steps);

  /// Number of the operation that eliminates a segment, or that adds group `group` of
  /// QuadraticModel::between[pair]. -1 for segments beyond all contacts.
  int OperationOf(int curve, int segment) const {
    return of_segments_[static_cast<std::size_t>(curve)][static_cast<std::size_t>(segment)];
  }
  int OperationOfGroup(int pair, int group) const {
    return of_groups_[static_cast<std::size_t>(pair)][static_cast<std::size_t>(group)];
  }

 private:
  // Advances `curve` over segment `index`, or if `pair` >= 0 adds its group `index`.
  struct Operation {
    int curve;
    int pair;
    int index;
  };
  // Inputs of the sweep for one curve, and its gains.
  struct Inputs {
    const WireModel* model = nullptr;
    const Curve* curve = nullptr;
    const CurveQuadraticModel* at = nullptr;
    double weight = 0;

    FrontSegment Segment(int i) const;
  };
  // Storage for a front of any size.
  struct Checkpoint {
    alignas(16) std::byte front[sizeof(Front<kMostFrontRows>)];
  };

  void FindCommon(const WireState& state, const QuadraticModel& quadratic);
  void Schedule(const WireState& state, const QuadraticModel& quadratic);
  void AdvanceTo(int curve, int cut, std::array<int, kMostInstruments>& cuts);
  bool Sweep(const WireState& state, const QuadraticModel& quadratic, double weight, int first);
  template <int... kSpins>
  bool SweepSlots(const QuadraticModel& quadratic, int first);
  template <int kSpins>
  bool SweepAlone(int curve, Front<SlotRows(kSpins)>& beyond);

  static constexpr int kSpacing = 16;  ///< operations from one checkpoint to the next
  std::vector<const WireModel*> rods_;
  std::array<int, kMostInstruments> slot_at_ = {};  ///< first row of each curve's slot
  int rows_ = 0;
  std::array<int, kMostInstruments> spin_rows_ = {};  ///< row of each instrument's spin, -1 without
  std::array<Inputs, kMostInstruments> inputs_;
  std::vector<Operation> operations_;
  /// By curve: number of segments in the common front. The others are swept alone.
  std::array<int, kMostInstruments> common_ = {};
  std::vector<std::vector<int>> of_segments_;  ///< by curve
  std::vector<std::vector<int>> of_groups_;    ///< by pair of curves
  std::vector<int> left_;  ///< by pair of curves: groups that Schedule has not ordered yet
  std::vector<std::vector<FrontGain>> gains_;  ///< by curve and segment
  std::vector<Checkpoint> checkpoints_;        ///< entry k: before operation k kSpacing
  double predicted_decrease_mJ_ = 0;
};

}  // namespace torquer
