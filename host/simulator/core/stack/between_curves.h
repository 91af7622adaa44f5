// Contact between the two curves of a stack: the inner instruments in the lumen of the outer ones
// (README, section 18).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/core/stack/instrument_stack.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// The springs between two curves at one state, and what they add to each segment. No heap after
/// Reserve.
struct BetweenCurves {
  /// Unknowns that move a place on a segment of both curves: the displacement of its distal node
  /// (3) and its own step (2), of the first curve and then of the second.
  using Vector = Eigen::Matrix<double, 10, 1>;
  using Matrix = Eigen::Matrix<double, 10, 10>;

  /// Where the inner curve is near the lumen's wall, or beyond it.
  struct Spring {
    int segment = 0;
    double stiffness_N_mm = 0;  ///< of the lumen, times the length that the place stands for
    double penetration_mm = 0;  ///< negative: how far it is from touching
    Vector approach;            ///< d penetration / d steps
    Matrix curvature;  ///< Hessian without stiffness approach approach', mJ, where touching
  };
  /// Sums over the springs of a segment.
  struct Terms {
    bool any = false;
    Vector gradient;  ///< N, mJ
    Matrix hessian;
  };

  std::vector<Spring> springs;  ///< from the sheath on
  std::vector<Terms> terms;     ///< one a segment of the second curve
  double energy_mJ = 0;
  double pressed_N = 0;          ///< sum of what presses the inner curve on the lumen
  double end_pressed_N = 0;      ///< of this, at the end of the shorter one: a mouth, or a tip
  double largest_offset_mm = 0;  ///< between the two curves, across

  /// Room for as many segments and points.
  void Reserve(int segments, int points_per_segment);
  /// Finds the springs. `frames` and `second_frames`: the tangent planes of both curves.
  void Place(const InstrumentStack& stack, const WireState& state, int points_per_segment,
             const std::vector<Frame>& frames, const std::vector<Frame>& second_frames);
  /// Sums the springs up for which `acts(k)` is true.
  template <class Acts>
  void Sum(Acts acts) {
    for (Terms& term : terms) term.any = false;
    for (std::size_t k = 0; k < springs.size(); ++k) {
      if (acts(k)) Add(springs[k]);
    }
  }
  /// Sums up those that touch.
  void SumTouching() {
    Sum([this](std::size_t k) { return springs[k].penetration_mm > 0; });
  }

 private:
  void Add(const Spring& spring);
};

}  // namespace torquer
