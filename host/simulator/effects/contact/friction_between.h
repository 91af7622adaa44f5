// Coulomb friction between instruments, with stick and slip.
//
// Along the wire it is internal, since no instrument can be stretched. Hands feel it
// (core/stack/hand_forces); shapes do not depend on it. About the wire it holds instruments that
// twist against each other. At a segment, N is the force of an instrument against the next one
// around it, and r its radius. With
//   s = (way along it, r times turn)
// as the relative motion of both since an anchor, the energy is that of StickSlip with the limit mu
// N. Both ways share one cone, so an instrument that slides along is easily turned.
//
// Friction also acts between curves, and then on their shapes (lumen_friction.h). Such curves have
// room in a lumen, lie beside each other, or touch themselves.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "host/simulator/effects/contact/lumen_friction.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class FrictionBetween final : public Effect,
                              public EnergyTerm,
                              public ContactTerm,
                              public BetweenTerm {
 public:
  /// `coefficient` in [0, 2]; `slip_mm` in [1e-5, 0.1]: the motion of a sticking contact before it
  /// slips. `context` needs its stack, of at least two instruments, or of one that touches itself.
  FrictionBetween(double coefficient, double slip_mm, const EffectContext& context);

  EnergyTerm* energy_term() override { return this; }
  ContactTerm* contact_term() override { return this; }
  BetweenTerm* between_term() override { return this; }
  void CopyFrom(const Effect& twin) override;

  bool Dissipates() const override { return true; }
  bool ActsOnWall() const override { return false; }
  const Sliding& sliding() const override { return sliding_; }
  bool SlidesInLumen() const override { return in_lumen_.has_value(); }
  void Begin(const PointSet& points) override;
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

 private:
  // Anchor of an instrument in the next one around it, by segments from the tip.
  struct Anchor {
    int outer = -1;        // index of the next one around it; -1 without one
    double along_mm = 0;   // sliding of the instrument in it since the anchor
    double turn_rad = 0;   // relative turn of the instrument at the anchor
    double limit_N = 0;    // mu N at the part's start
    double radius_mm = 0;  // radius of the instrument
  };
  using Anchors = std::array<Anchor, kMostInstruments>;  // by instrument; the outermost has none

  // Anchors on a curve.
  struct OnCurve {
    std::vector<Anchors> anchors;  // by segment from the tip; empty without twist
    int anchored = 0;              // anchors beyond this many are blank

    Anchors& At(const PointSet& points, int segment) {
      return anchors[static_cast<std::size_t>(points.segments() - 1 - segment)];
    }
    const Anchors& At(const PointSet& points, int segment) const {
      return anchors[static_cast<std::size_t>(points.segments() - 1 - segment)];
    }
  };
  OnCurve& AnchorsOn(const PointSet& points) {
    return on_curves_[static_cast<std::size_t>(points.among.curve)];
  }

  const double slip_mm_;
  const InstrumentStack& stack_;
  Sliding sliding_;
  std::vector<OnCurve> on_curves_;         ///< by curve
  std::optional<LumenFriction> in_lumen_;  ///< empty if one curve touches nothing
};

EffectKind FrictionBetweenKind();

}  // namespace torquer::effects
