// Contact between the two curves of a stack: the inner instruments in the lumen of the outer ones
// (README, section 18).
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <vector>

#include "host/simulator/core/energy_term.h"
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
    double past_mm = 0;         ///< past the proximal node of the inner curve's segment
    double ahead_mm = 0;        ///< so much farther on the outer curve's
    double stiffness_N_mm = 0;  ///< of the lumen, times the length that the place stands for
    double penetration_mm = 0;  ///< negative: how far it is from touching
    Vector approach;            ///< d penetration / d steps
    Matrix curvature;  ///< Hessian without stiffness approach approach', mJ, where touching
  };
  /// Where a term acts on how the surfaces slide against each other.
  struct Slide {
    SlideLoad load;
    int segment = 0;
    double past_mm = 0;        ///< as of a spring
    double ahead_mm = 0;       ///< the same
    Vector along;              ///< d way along / d steps
    Vector around;             ///< d way around / d steps
    Matrix curvature;          ///< what the second derivatives of the ways add to the Hessian, mJ
    double inner_spin_mm = 0;  ///< d way around / d spin of the inner instrument
    double outer_spin_mm = 0;  ///< d way around / d spin of the outer one
  };
  /// Sums over the springs and slides of a segment.
  struct Terms {
    bool any = false;
    Vector gradient;  ///< N, mJ
    Matrix hessian;
  };
  /// Sums over the slides of a segment of instruments that twist, by their numbers. The gradient by
  /// the spins is in StackTerms.
  struct SpinTerms {
    bool any = false;
    Eigen::Matrix<double, kMostInstruments, 10> with_steps;
    Eigen::Matrix<double, kMostInstruments, kMostInstruments> hessian;
  };

  std::vector<Spring> springs;        ///< from the sheath on
  std::vector<Slide> slides;          ///< the same
  std::vector<Terms> terms;           ///< one a segment of the second curve
  std::vector<SpinTerms> spin_terms;  ///< the same
  double energy_mJ = 0;
  double pressed_N = 0;          ///< sum of what presses the inner curve on the lumen
  double end_pressed_N = 0;      ///< of this, at the end of the shorter one: a mouth, or a tip
  double largest_offset_mm = 0;  ///< between the two curves, across

  /// Places in the middle of as many pieces of a segment. One alone would let nodes go to and fro;
  /// at a node the lumen's normal would be that of one of its two segments.
  static int PlacesPerSegment(int points_per_segment) { return std::max(2, points_per_segment); }
  /// The most places that curves of so many segments have.
  static std::size_t MostPlaces(int segments, int points_per_segment) {
    return (static_cast<std::size_t>(segments) + 1) *
               static_cast<std::size_t>(PlacesPerSegment(points_per_segment)) +
           1;
  }
  /// Room for as many segments and points.
  void Reserve(int segments, int points_per_segment);
  /// Finds the springs. `frames` and `second_frames`: the tangent planes of both curves. `lumen`:
  /// takes all places, where it is given.
  void Place(const InstrumentStack& stack, const WireState& state, int points_per_segment,
             const std::vector<Frame>& frames, const std::vector<Frame>& second_frames,
             std::vector<LumenContact>* lumen);
  /// Takes over what terms have found at places in the lumen of the same state.
  void TakeSlides(const InstrumentStack& stack, const WireState& state, const PointSet& points,
                  const std::vector<SlideLoad>& loads, const std::vector<Frame>& frames,
                  const std::vector<Frame>& second_frames);
  /// Sums up the springs for which `acts(k)` is true, and all slides.
  template <class Acts>
  void Sum(Acts acts) {
    for (Terms& term : terms) term.any = false;
    for (std::size_t k = 0; k < springs.size(); ++k) {
      if (acts(k)) Add(springs[k]);
    }
    for (const Slide& slide : slides) Add(slide);
  }
  /// Sums up those that touch.
  void SumTouching() {
    Sum([this](std::size_t k) { return springs[k].penetration_mm > 0; });
  }

 private:
  Terms& TermsOf(int segment);
  void Add(const Spring& spring);
  void Add(const Slide& slide);
  void AddSpins(const Slide& slide, const LumenContact& contact);
};

}  // namespace torquer
