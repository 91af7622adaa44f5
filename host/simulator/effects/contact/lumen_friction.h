// Coulomb friction between the inner of two curves and the lumen in which it has room
// (core/README.md, section 18).
//
// At every place that touches, with N the force of the contact and
//   s = (way along the lumen, way around it)
// how far both surfaces have slid against each other since an anchor, its energy is that of
// StickSlip with the limit mu N: both ways share one cone. The way around has the turn of the inner
// surface in it, so that a wire that rolls in the lumen does not slide. As on the wall, N and the
// direction around are those of the start of a part, and the anchor follows where a place has
// slipped.
#pragma once

#include <array>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class LumenFriction {
 public:
  /// As FrictionBetween. `context` needs a stack with room in a lumen.
  LumenFriction(double coefficient, double slip_mm, const EffectContext& context);

  void Begin(const PointSet& points);
  double Add(const PointSet& points, PointDerivatives& out) const;
  void MoveSurfaces(const PointSet& points, const std::array<SurfaceMove, kMostInstruments>& moves);
  void End(const PointSet& points);
  void Reset();
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  // A place that is held; it moves with the curve that reaches farthest, as the points do.
  struct Held {
    Eigen::Vector2d way_mm = Eigen::Vector2d::Zero();  // since the anchor: along, around
    double limit_N = 0;                                // mu N at the part's start; 0: not held
    LumenContact from;                                 // the contact at the part's start
    Eigen::Vector2d around = Eigen::Vector2d::Zero();  // unit, by the normals of the lumen
  };

  // How far a place has slid since its anchor.
  static Eigen::Vector2d WayMm(const Held& held, const LumenContact& contact);
  static bool Holds(const Held& held, const LumenContact& contact);
  // The memory of a place of PointSet::lumen; that of the end comes first.
  static std::size_t MemoryOf(const PointSet& points, std::size_t place);

  double coefficient_;
  double slip_mm_;
  std::vector<Held> held_;
};

}  // namespace torquer::effects
