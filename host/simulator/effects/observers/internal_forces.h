// What the wire bears along its length, and what the hands of its instruments feel.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "host/simulator/core/stack/hand_forces.h"
#include "host/simulator/effects/effect.h"

namespace torquer::effects {

class InternalForceObserver final : public Effect, public Observer {
 public:
  /// The friction between instruments, of this coefficient, acts against the way in which each slid
  /// last in those around it. `context` needs its stack and instruments.
  InternalForceObserver(double friction_between, const EffectContext& context);

  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;
  const InternalForces* AlongWire() const override { return &forces_; }
  const std::array<HandForce, kMostInstruments>* AtHands() const override {
    return &hands_.hands();
  }

 private:
  void FollowSliding(const InstrumentPlaces& places);

  const InstrumentStack& stack_;
  std::vector<std::string> names_;
  std::vector<EnergyTerm*> terms_;
  Sliding sliding_;
  std::vector<double> insertion_mm_;  ///< at the tick before; empty at the start
  InternalForces forces_;
  HandForces hands_;
};

EffectKind InternalForcesKind();

}  // namespace torquer::effects
