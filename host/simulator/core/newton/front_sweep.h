// Newton step of instruments that twist, or lie on two curves, in O(n): one front for all of them
// (README, sections 6, 17 and 18).
//
//   segments  0 ............. m-1 | m ............. n-1
//   first     ====================|====================   the leader's curve
//   second    --------------------|
//                both in a front  |  the first alone
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "host/simulator/core/newton/front.h"

namespace torquer {

/// Sweep with the members of RiccatiSweep, which documents them.
class FrontSweep {
 public:
  /// `second`: the rod on the second curve, which must outlive this; null for one curve.
  FrontSweep(int max_segments, const WireModel* second);

  bool Factor(const WireModel& model, const WireState& state, const Expansion& expansion,
              double weight);
  bool Refactor(const WireModel& model, const WireState& state, const Expansion& expansion,
                double weight, int last_changed);
  double Step(const WireModel& model, const WireState& state, const Expansion& expansion,
              std::vector<Eigen::Vector2d>& step, std::vector<double>& spin,
              std::vector<Eigen::Vector3d>& displacement_mm);

  /// Steps of the second curve from the last Step.
  const std::vector<Eigen::Vector2d>& second_step() const { return second_step_; }
  const std::vector<double>& second_spin() const { return second_spin_; }
  const std::vector<Eigen::Vector3d>& second_displacement_mm() const {
    return second_displacement_mm_;
  }

 private:
  // Inputs of the sweep for one curve, and its gains.
  struct Curve {
    const WireModel& model;
    const WireState& state;
    const Expansion& at;
    double weight;
    std::vector<FrontGain>& gains;

    FrontSegment Segment(int i) const;
  };
  // Storage for a front of any size.
  struct Checkpoint {
    alignas(16) std::byte front[sizeof(Front<kMostFrontRows>)];
  };

  // Sweeps from segment `first` to the sheath. Beyond `first` it starts from a checkpoint or the
  // tip.
  bool Sweep(const WireModel& model, const WireState& state, const Expansion& expansion,
             double weight, int first);
  template <int kSpins>
  bool SweepOne(const Curve& curve, int first);
  bool SweepCurves(const Curve& one, const Curve& second, const BetweenCurves& between, int first);
  template <int kSpins, int kOtherSpins>
  bool SweepSlots(const Curve& one, const Curve& other, int first_slot,
                  const BetweenCurves& between, int first);
  template <class AnyFront>
  void Keep(int segment, const AnyFront& front);
  template <class AnyFront>
  void Restore(int segment, AnyFront& front) const;

  static constexpr int kSpacing = 16;  ///< segments from one checkpoint to the next
  const WireModel* second_;
  std::vector<FrontGain> gains_[2];      ///< by curve and segment
  std::vector<Checkpoint> checkpoints_;  ///< entry k: front of all segments from k kSpacing on
  double predicted_decrease_mJ_ = 0;
  std::vector<Eigen::Vector2d> second_step_;
  std::vector<double> second_spin_;
  std::vector<Eigen::Vector3d> second_displacement_mm_;
};

}  // namespace torquer
