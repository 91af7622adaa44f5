// Coulomb friction of instruments on each other, with stick and slip.
//
// Along the wire it is internal, since no instrument can be stretched: hands feel it
// (core/stack/hand_forces), shapes do not. About the wire it holds instruments that twist against
// each other. At a segment, with N the force that presses an instrument against the next one around
// it, r its radius and
//   s = (way along it, r times turn)
// how far both have moved against each other since an anchor, its energy is that of StickSlip with
// the limit mu N: both ways share one cone. What slides along is therefore easily turned.
//
// Where a lumen has room, friction acts between its two curves as well, on their shapes, too:
// lumen_friction.h.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "host/simulator/effects/contact/lumen_friction.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class FrictionBetween final : public Effect, public EnergyTerm {
 public:
  /// `coefficient` in [0, 2]; `slip_mm` in [1e-5, 0.1]: how far what sticks moves before it slips.
  /// `context` needs its stack, of two instruments or more.
  FrictionBetween(double coefficient, double slip_mm, const EffectContext& context);

  EnergyTerm* energy_term() override { return this; }
  void CopyFrom(const Effect& twin) override;

  bool Dissipates() const override { return true; }
  const Sliding* SlidingBetween() const override { return &sliding_; }
  bool SlidesInLumen() const override { return in_lumen_.has_value(); }
  void Begin(const PointSet& points) override;
  double Add(const PointSet& points, PointDerivatives& out) const override;
  void MoveSurfaces(const PointSet& points,
                    const std::array<SurfaceMove, kMostInstruments>& moves) override;
  void End(const PointSet& points) override;
  void Reset() override;
  std::uint64_t Hash(std::uint64_t seed) const override;

 private:
  // Of an instrument and the next one around it, by segments from the tip.
  struct Anchor {
    int outer = -1;        // the next one around it; -1: none is there
    double along_mm = 0;   // how far the instrument has slid in it since the anchor
    double turn_rad = 0;   // of the instrument in it, where the anchor is
    double limit_N = 0;    // mu N at the part's start
    double radius_mm = 0;  // of the instrument
  };
  using Anchors = std::array<Anchor, kMostInstruments>;  // by instrument; the outermost has none

  Anchors& AnchorsAt(const PointSet& points, int segment) {
    return anchors_[static_cast<std::size_t>(points.segments() - 1 - segment)];
  }
  const Anchors& AnchorsAt(const PointSet& points, int segment) const {
    return anchors_[static_cast<std::size_t>(points.segments() - 1 - segment)];
  }

  const double slip_mm_;
  const InstrumentStack& stack_;
  Sliding sliding_;
  std::vector<Anchors> anchors_;           ///< empty where nothing twists
  int anchored_ = 0;                       ///< anchors beyond this many are blank
  std::optional<LumenFriction> in_lumen_;  ///< none where no lumen has room
};

EffectKind FrictionBetweenKind();

}  // namespace torquer::effects
