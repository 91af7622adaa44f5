// Self contact: instruments that touch themselves, as in a loop or in a coil in an aneurysm.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Reading of the contact of each curve with itself. The core has the pairs and their springs
/// (core/README.md section 18).
class SelfContactObserver final : public Effect, public Observer {
 public:
  Observer* observer() override { return this; }
  void Restart() override { pressed_N_ = 0; }
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

 private:
  double pressed_N_ = 0;
};

EffectKind SelfContactKind();

}  // namespace torquer::effects
