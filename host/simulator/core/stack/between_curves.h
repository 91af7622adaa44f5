// Contact between two curves of a stack (README, section 18). The inner instruments lie in the
// lumen of the outer ones, or both curves lie beside each other.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/point_derivatives.h"
#include "host/simulator/core/point_set.h"
#include "host/simulator/core/stack/lumen_pairs.h"
#include "host/simulator/core/wire_state.h"

namespace torquer {

/// Springs between two curves at one state, and their terms in each segment. No heap after Reserve.
struct BetweenCurves {
  /// Unknowns that move a place and its foot: displacement of the segment's distal node (3), and
  /// the segment's step (2). The unknowns of the inner curve come first.
  using Vector = Eigen::Matrix<double, 10, 1>;
  using Matrix = Eigen::Matrix<double, 10, 10>;

  /// Contact spring: a place at which the inner curve is near the lumen's wall, or beyond it.
  struct Spring {
    int group = 0;       ///< index of its segments in `groups`
    double past_mm = 0;  ///< past the proximal node of the inner segment
    double foot_mm = 0;  ///< of its foot, past the proximal node of the outer segment
    double stiffness_N_mm =
        0;  ///< stiffness of the lumen times the length that the place stands for
    double penetration_mm = 0;  ///< negative: minus the distance to contact
    Vector approach;            ///< d penetration / d steps
    Matrix curvature;           ///< Hessian without stiffness approach approach', mJ, if touching
  };
  /// Place of curves beside each other, and the distance of their axes there.
  struct Neighbor {
    int group = 0;       ///< as in Spring
    double past_mm = 0;  ///< as in Spring
    double foot_mm = 0;  ///< as in Spring
    double apart_mm = 0;
    double touching_mm = 0;  ///< distance at which they touch
  };
  /// Place at which a term acts on the relative sliding of the surfaces.
  struct Slide {
    SlideLoad load;
    int group = 0;       ///< as in Spring
    double past_mm = 0;  ///< as in Spring
    double foot_mm = 0;  ///< as in Spring
    int inner = 0;       ///< instrument that slides in the lumen
    int outer = 0;       ///< instrument of the lumen
    Vector along;        ///< d sliding along / d steps
    Vector around;       ///< d sliding around / d steps
    Matrix curvature;    ///< Hessian terms from the second derivatives of the sliding, mJ
    /// d (sliding along, around) / d spin of the inner and of the outer instrument.
    Eigen::Vector2d inner_spin_mm = Eigen::Vector2d::Zero();
    Eigen::Vector2d outer_spin_mm = Eigen::Vector2d::Zero();
    /// Hessian terms of both spins from the second derivatives, mJ: with the steps, and with each
    /// other. Zero in a lumen.
    std::array<Vector, 2> spin_with_steps = {Vector::Zero(), Vector::Zero()};
    Eigen::Matrix2d spin_curvature = Eigen::Matrix2d::Zero();
  };
  /// Sums over the springs and slides of a pair of segments.
  struct Terms {
    bool any = false;
    Vector gradient;  ///< N, mJ
    Vector force;     ///< like gradient, without springs that do not press
    Matrix hessian;
  };
  /// Sums over the slides of a pair of segments of instruments that twist, by instrument. For
  /// curves that cross, by side: 0 of the inner curve, 1 of the outer one (perhaps the same). The
  /// gradient by the spins is in the terms of the segments.
  struct SpinTerms {
    bool any = false;
    /// By side: the instrument that slides on the first of the slides. Others that slide on a pair
    /// of segments of curves that cross are not coupled with steps.
    std::array<int, 2> surface = {};
    Eigen::Matrix<double, kMostInstruments, 10> with_steps;
    Eigen::Matrix<double, kMostInstruments, kMostInstruments> hessian;
  };

  int inner = 0;                      ///< number of the inner curve
  int outer = 0;                      ///< number of the outer curve
  bool beside = false;                ///< the curves lie beside each other, not within
  bool turned_back = false;           ///< as in LumenPairs
  bool ordered = true;                ///< as in LumenPairs
  bool at_mouth = false;              ///< the last place is the outer curve's mouth
  std::vector<SegmentPair> groups;    ///< pairs of segments that face each other, from the sheath
  std::vector<Spring> springs;        ///< ordered from the sheath
  std::vector<Slide> slides;          ///< ordered from the sheath
  std::vector<Neighbor> neighbors;    ///< ordered from the sheath; empty for curves within
  std::vector<Terms> terms;           ///< one for each of `groups`
  std::vector<SpinTerms> spin_terms;  ///< same; empty without sliding and twisting
  double energy_mJ = 0;
  double pressed_N = 0;          ///< sum of the contact forces between inner curve and lumen
  double end_pressed_N = 0;      ///< part of pressed_N at the last place: a mouth, or a tip
  double largest_offset_mm = 0;  ///< between the two curves, across

  /// Curves with the tangent planes of their segments.
  struct Geometry {
    const Curve& curve;
    const WireModel& rod;
    const std::vector<Frame>& frames;
  };
  /// Takes over the kind of `pairs`, and reserves room for its places, as many as its vectors have
  /// room for.
  void Reserve(const LumenPairs& pairs);
  /// Finds the springs. `lumen`: if not null, receives the contacts at all spots of `pairs`, behind
  /// those that it has.
  void Place(const LumenPairs& pairs, double stiffness_N_mm2, const Geometry& inner_curve,
             const Geometry& outer_curve, std::vector<LumenContact>* lumen);
  /// Takes over the loads that terms found at the spots of the same state. `lumen`: all contacts of
  /// the inner curve. `first_contact`: number of those before the contacts of curves that cross.
  void TakeSlides(const LumenPairs& pairs, const Geometry& inner_curve, const Geometry& outer_curve,
                  const std::vector<LumenContact>& lumen, std::size_t first_contact,
                  const std::vector<SlideLoad>& loads);
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
  Terms& TermsOf(int group);
  void Add(const Spring& spring);
  void Add(const Slide& slide);
  static void AddContacts(const LumenPairs& pairs, const Geometry& inner, const Geometry& outer,
                          std::vector<LumenContact>& contacts);
  void AddSpins(const Slide& slide);
};

}  // namespace torquer
