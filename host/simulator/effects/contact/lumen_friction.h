// Coulomb friction between a curve and the lumen in which it has room (core/README.md, section 18).
// It also acts between curves beside each other, and of a curve with itself.
//
// At every contact place, N is the contact force. With
//   s = (way along the lumen, way around it)
// as the relative sliding of both surfaces since an anchor. The energy is that of StickSlip with
// the limit mu N. Both ways share one cone. The way around includes the turn of the inner surface.
// So a wire that rolls in the lumen does not slide. As on the wall, N and the direction around are
// those at the start of a part. The anchor follows a place that has slipped.
#pragma once

#include <array>
#include <vector>

#include "host/simulator/effects/contact/held_contact.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class LumenFriction {
 public:
  /// Like FrictionBetween. `context` needs a stack of several curves, or of instruments that touch
  /// themselves.
  LumenFriction(double coefficient, double slip_mm, const EffectContext& context);

  void Begin(const PointSet& points);
  double Add(const PointSet& points, PointDerivatives& out) const;
  void MoveSurfaces(const PointSet& points, const std::array<SurfaceMove, kMostInstruments>& moves);
  void End(const PointSet& points);
  void Reset();
  std::uint64_t Hash(std::uint64_t seed) const;

 private:
  // Places of a curve in lumens, or beside another curve in order, and their memory from the tip.
  struct Side {
    const std::vector<LumenContact>& contacts;
    std::vector<HeldContact>& held;
    std::size_t pieces;  // of the curve

    std::size_t MemoryOf(std::size_t place) const { return pieces - 1 - place; }
    HeldContact& HeldAt(std::size_t place) const { return held[MemoryOf(place)]; }
  };
  static constexpr std::size_t kSides = 2;
  std::array<Side, kSides> SidesOf(const PointSet& points);
  static void BeginSide(const Side& side, double coefficient);
  // Memory of the places of a curve that cross, in their order: any number for each piece.
  struct Crossing {
    std::vector<HeldContact> held;
    std::vector<HeldContact> before;  // those of the part before, during Begin
  };
  Crossing& CrossingOf(const PointSet& points) {
    return crossing_[static_cast<std::size_t>(points.among.curve)];
  }
  void BeginCrossing(const std::vector<LumenContact>& contacts, Crossing& crossing) const;

  double coefficient_;
  double slip_mm_;
  // By curve: in lumens, beside others.
  std::vector<std::array<std::vector<HeldContact>, kSides>> held_;
  std::vector<Crossing> crossing_;  // by curve
};

}  // namespace torquer::effects
