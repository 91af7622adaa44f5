// Newton step of instruments that twist, lie on several curves or touch themselves. One front
// serves all of them, in O(n) (README, sections 6, 17 and 18).
//
//   inner    ====================|====================
//   outer    --------------------|                      within: an operation at a time, from the
//   mouth
//                in one front    |  the inner alone     to the sheath
//
// front_schedule.h orders the operations.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "host/simulator/core/newton/curve_step.h"
#include "host/simulator/core/newton/front.h"
#include "host/simulator/core/newton/front_schedule.h"
#include "host/simulator/core/newton/open_rows.h"

namespace torquer {

/// Sweep like RiccatiSweep, for all curves of a state.
class FrontSweep {
 public:
  /// `rods`: the model of each curve, which must outlive this. `between`: contacts with room for
  /// all that a quadratic model will have.
  FrontSweep(std::vector<const WireModel*> rods, const std::vector<BetweenCurves>& between);

  /// Eliminates all segments. Returns false if a pivot is not positive definite. `weight`: proximal
  /// weight, in units of the local EI/(1 mm).
  bool Factor(const WireState& state, const QuadraticModel& quadratic, double weight);
  /// Like Factor, if since the last one only operations from number `first` on have other loads.
  bool Refactor(const WireState& state, const QuadraticModel& quadratic, double weight, int first);
  /// Steps of all curves. Returns the predicted decrease of the energy, mJ.
  double Step(const WireState& state, const QuadraticModel& quadratic,
              std::vector<CurveStep>& steps);

  const FrontSchedule& schedule() const { return schedule_; }

 private:
  // Inputs of the sweep for one curve, and its gains.
  struct Inputs {
    const WireModel* model = nullptr;
    const Curve* curve = nullptr;
    const CurveQuadraticModel* at = nullptr;
    double weight = 0;
    const StackTerms* spins = nullptr;  ///< by segment; null without

    FrontSegment Segment(int i) const;
  };
  // Storage for a front of any size.
  struct Checkpoint {
    alignas(16) std::byte front[sizeof(Front<kMostFrontRows>)];
  };

  void TakeTwists(int curve);
  bool Sweep(const WireState& state, const QuadraticModel& quadratic, double weight, int first);
  template <int... kSpins>
  bool SweepSlots(const QuadraticModel& quadratic, int first);
  template <int kSpins>
  bool SweepAlone(int curve, Front<SlotRows(kSpins)>& beyond);
  template <int kSlot, int kAt, int kSpins, int kRows>
  bool Advance(const FrontOperation& operation, Front<kRows>& front);
  SideRows RowsOf(int curve, int surface) const;
  template <int kRows>
  void Add(const FrontOperation& operation, const QuadraticModel& quadratic, Front<kRows>& front);

  static constexpr int kSpacing = 16;  ///< operations from one checkpoint to the next
  std::vector<const WireModel*> rods_;
  std::array<int, kMostInstruments> slot_at_ = {};  ///< first row of each curve's slot
  int rows_ = 0;
  std::array<int, kMostInstruments> controls_ = {};   ///< of each curve
  std::array<int, kMostInstruments> spin_rows_ = {};  ///< row of each instrument's spin, -1 without
  std::array<Inputs, kMostInstruments> inputs_;
  OpenRows open_;
  FrontSchedule schedule_;
  std::vector<StackTerms> twists_;             ///< by segment, of a lone wire that twists
  std::vector<std::vector<FrontGain>> gains_;  ///< by curve and segment
  std::vector<double> open_gains_;             ///< of the open rows
  std::vector<Checkpoint> checkpoints_;        ///< entry k: before operation k kSpacing
  double predicted_decrease_mJ_ = 0;
};

}  // namespace torquer
