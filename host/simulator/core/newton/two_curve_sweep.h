// The sweep of two curves (README, section 18): a stage has a segment of each.
//
//   stages   0 ............. m-1 | m ............. n-1
//   first    ====================|====================   the leader's curve, n segments
//   second   --------------------|                       m of them
//              both: 12 by 4     |   one: 6 by 2
//
// The state of a stage is, for each curve, the displacement of its proximal node, the step of the
// segment before and the turn of that segment's untwisted frame; the control is the step of each.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "host/simulator/core/newton/riccati_sweep.h"

namespace torquer {

/// A stage with a segment of each of two curves, none of which twists.
struct TwoCurveStage {
  static constexpr bool kTwists = false;
  static constexpr bool kStack = false;
  static constexpr bool kTwoCurves = true;
};

/// As RiccatiSweep of one curve, which says what its members mean.
template <>
class RiccatiSweep<TwoCurveStage> {
 public:
  explicit RiccatiSweep(int max_segments);

  bool Factor(const WireModel& model, const WireState& state, const Expansion& expansion,
              double weight);
  bool Refactor(const WireModel& model, const WireState& state, const Expansion& expansion,
                double weight, int last_changed);
  double Step(const WireModel& model, const WireState& state, const Expansion& expansion,
              std::vector<Eigen::Vector2d>& step, std::vector<double>& spin,
              std::vector<Eigen::Vector3d>& displacement_mm);

  /// Of the second curve, as the last Step found them.
  const std::vector<Eigen::Vector2d>& second_step() const { return second_step_; }
  const std::vector<Eigen::Vector3d>& second_displacement_mm() const {
    return second_displacement_mm_;
  }

 private:
  static constexpr int kCurve = 6;  // of one curve: displacement 3, step 2, turn 1
  template <int kCurves>
  struct CostToGo {
    Eigen::Matrix<double, kCurve * kCurves, kCurve* kCurves> p =
        Eigen::Matrix<double, kCurve * kCurves, kCurve * kCurves>::Zero();
    Eigen::Matrix<double, kCurve * kCurves, 1> g =
        Eigen::Matrix<double, kCurve * kCurves, 1>::Zero();
    Eigen::Matrix<double, 3, kCurves> force_N =
        Eigen::Matrix<double, 3, kCurves>::Zero();  // of the loads beyond
    double decrease = 0;
  };
  // The control is -(of_given z + constant).
  struct Gain {
    Eigen::Matrix<double, 4, 12> of_given;
    Eigen::Matrix<double, 4, 1> constant;
  };

  template <int kCurves>
  bool Stage(const WireModel& model, const WireState& state, const Expansion& expansion,
             double weight, int i, CostToGo<kCurves>& v);
  bool SweepBoth(const WireModel& model, const WireState& state, const Expansion& expansion,
                 double weight, int first, CostToGo<2> v);

  static constexpr int kSpacing = 16;
  std::vector<Gain> gains_;
  std::vector<CostToGo<2>> checkpoints_;  // k: of all from stage k kSpacing on, of those with both
  double predicted_decrease_ = 0;
  std::vector<Eigen::Vector2d> second_step_;
  std::vector<Eigen::Vector3d> second_displacement_mm_;
};

}  // namespace torquer
