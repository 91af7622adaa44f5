// Coulomb friction between a curve and the lumen in which it has room, and between curves beside
// each other (core/README.md, section 18).
//
// At every contact place, N is the contact force. With
//   s = (way along the lumen, way around it)
// as the relative sliding of both surfaces since an anchor, the energy is that of StickSlip with
// the limit mu N. Both ways share one cone. The way around includes the turn of the inner surface,
// so a wire that rolls in the lumen does not slide. As on the wall, N and the direction around are
// those at the start of a part. The anchor follows a place that has slipped.
#pragma once

#include <array>
#include <vector>

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class LumenFriction {
 public:
  /// Like FrictionBetween. `context` needs a stack with room in a lumen.
  LumenFriction(double coefficient, double slip_mm, const EffectContext& context);

  void Begin(const PointSet& points);
  double Add(const PointSet& points, PointDerivatives& out) const;
  void MoveSurfaces(const PointSet& points, const std::array<SurfaceMove, kMostInstruments>& moves);
  void End(const PointSet& points);
  void Reset();
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  // Memory of a place. It moves with the inner curve.
  struct Held {
    Eigen::Vector2d slid_mm = Eigen::Vector2d::Zero();  // since the anchor: along, around
    double limit_N = 0;                                 // mu N at the part's start; 0: no friction
    LumenContact from;                                  // the contact at the part's start
    Eigen::Vector2d around = Eigen::Vector2d::Zero();   // unit, in the normals of the lumen
  };

  // Sliding of a place since its anchor, mm.
  static Eigen::Vector2d SlidMm(const Held& held, const LumenContact& contact);
  static bool Holds(const Held& held, const LumenContact& contact);
  // True if the place faced another segment of the lumen at the part's start. The directions around
  // the lumen then have no common zero, so it does not slide around until the part ends.
  static bool Changed(const Held& held, const LumenContact& contact) {
    return contact.outer_from_tip != held.from.outer_from_tip;
  }
  // Places of a curve in lumens, or beside another curve, and their memory from the tip.
  struct Side {
    const std::vector<LumenContact>& contacts;
    std::vector<Held>& held;
    std::size_t pieces;  // of the curve

    std::size_t MemoryOf(std::size_t place) const { return pieces - 1 - place; }
    Held& HeldAt(std::size_t place) const { return held[MemoryOf(place)]; }
  };
  static constexpr std::size_t kSides = 2;
  std::array<Side, kSides> SidesOf(const PointSet& points);
  static void BeginSide(const Side& side, double coefficient);
  double AddPlace(const Held& held, const LumenContact& contact, SlideLoad& load) const;

  double coefficient_;
  double slip_mm_;
  std::vector<std::array<std::vector<Held>, kSides>> held_;  // by curve: in lumens, beside others
};

}  // namespace torquer::effects
