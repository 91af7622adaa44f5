// Internal force observer: forces along the wire, and forces at the hands of its instruments.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Forces of a tick that did not converge are not known: they are NaN.
class InternalForceObserver final : public Effect, public Observer {
 public:
  /// `context` needs its instruments. Friction between instruments is that of the
  /// friction effect made before this one; without such an effect there is none.
  explicit InternalForceObserver(const EffectContext& context);

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;
  const InternalForces* AlongWire() const override { return &forces_; }
  const std::array<HandForce, kMostInstruments>* AtHands() const override { return &at_hands_; }

 private:
  void Forget();

  std::vector<std::string> names_;
  std::vector<EnergyTerm*> terms_;
  const Sliding* sliding_ = nullptr;  ///< null without friction between instruments
  InternalForces forces_;
  HandForces hands_;
  std::array<HandForce, kMostInstruments> at_hands_{};
};

EffectKind InternalForcesKind();

}  // namespace torquer::effects
