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

/// Springs between two curves at one state, and their terms in each segment. No heap after Reserve.
struct BetweenCurves {
  /// Unknowns that move a place on a segment of both curves: the displacement of its distal node
  /// (3) and its own step (2). Those of the first curve come first.
  using Vector = Eigen::Matrix<double, 10, 1>;
  using Matrix = Eigen::Matrix<double, 10, 10>;

  /// Contact spring: a place at which the inner curve is near the lumen's wall, or beyond it.
  struct Spring {
    int segment = 0;
    double past_mm = 0;  ///< past the proximal node of the inner curve's segment
    double ahead_mm =
        0;  ///< shift of the place on the outer curve's segment against that of the inner one
    double stiffness_N_mm =
        0;  ///< stiffness of the lumen times the length that the place stands for
    double penetration_mm = 0;  ///< negative: minus the distance to contact
    Vector approach;            ///< d penetration / d steps
    Matrix curvature;           ///< Hessian without stiffness approach approach', mJ, if touching
  };
  /// Place at which a term acts on the relative sliding of the surfaces.
  struct Slide {
    SlideLoad load;
    int segment = 0;
    double past_mm = 0;        ///< as in Spring
    double ahead_mm = 0;       ///< as in Spring
    Vector along;              ///< d sliding along / d steps
    Vector around;             ///< d sliding around / d steps
    Matrix curvature;          ///< Hessian terms from the second derivatives of the sliding, mJ
    double inner_spin_mm = 0;  ///< d sliding around / d spin of the inner instrument
    double outer_spin_mm = 0;  ///< d sliding around / d spin of the outer one
  };
  /// Sums over the springs and slides of a segment.
  struct Terms {
    bool any = false;
    Vector gradient;  ///< N, mJ
    Matrix hessian;
  };
  /// Sums over the slides of a segment of instruments that twist, by instrument. StackTerms has the
  /// gradient by the spins.
  struct SpinTerms {
    bool any = false;
    Eigen::Matrix<double, kMostInstruments, 10> with_steps;
    Eigen::Matrix<double, kMostInstruments, kMostInstruments> hessian;
  };

  std::vector<Spring> springs;        ///< ordered from the sheath
  std::vector<Slide> slides;          ///< ordered from the sheath
  std::vector<Terms> terms;           ///< one per segment of the second curve
  std::vector<SpinTerms> spin_terms;  ///< one per segment of the second curve
  double energy_mJ = 0;
  double pressed_N = 0;  ///< sum of the contact forces between inner curve and lumen
  double end_pressed_N =
      0;  ///< part of pressed_N at the end of the shorter curve: a mouth, or a tip
  double largest_offset_mm = 0;  ///< between the two curves, across

  /// Number of places per segment, each in the middle of a piece. With one place alone, nodes would
  /// go to and fro. At a node the lumen's normal would be that of only one of its two segments.
  static int PlacesPerSegment(int points_per_segment) { return std::max(2, points_per_segment); }
  /// Largest number of places of curves with `segments` segments.
  static std::size_t MostPlaces(int segments, int points_per_segment) {
    return (static_cast<std::size_t>(segments) + 1) *
               static_cast<std::size_t>(PlacesPerSegment(points_per_segment)) +
           1;
  }
  /// Reserves room for `segments` segments with `points_per_segment` points each.
  void Reserve(int segments, int points_per_segment);
  /// Finds the springs. `frames` and `second_frames`: the tangent planes of both curves. `lumen`:
  /// if not null, receives all places.
  void Place(const InstrumentStack& stack, const WireState& state, int points_per_segment,
             const std::vector<Frame>& frames, const std::vector<Frame>& second_frames,
             std::vector<LumenContact>* lumen);
  /// Takes over the loads that terms found at places in the lumen of the same state.
  void TakeSlides(const InstrumentStack& stack, const WireState& state, const PointSet& points,
                  const std::vector<SlideLoad>& loads, const std::vector<Frame>& frames,
                  const std::vector<Frame>& second_frames);
  /// Sums the springs for which `acts(k)` is true, and all slides.
  template <class Acts>
  void Sum(Acts acts) {
    for (Terms& term : terms) term.any = false;
    for (std::size_t k = 0; k < springs.size(); ++k) {
      if (acts(k)) Add(springs[k]);
    }
    for (const Slide& slide : slides) Add(slide);
  }
  /// Sums the touching springs and all slides.
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
