// Clearance: room between instruments. Those inside a lumen lie on another curve than those around.
#pragma once

#include "host/simulator/effects/effect.h"

namespace torquer::effects {

/// Readings of the contact in the lumen. The core has the curves and their coupling (core/README.md
/// section 18).
class ClearanceObserver final : public Effect, public Observer {
 public:
  Observer* observer() override { return this; }
  void Restart() override;
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  std::vector<Reading> Readings() const override;

 private:
  double pressed_N_ = 0;
  double end_pressed_N_ = 0;
  double offset_mm_ = 0;
};

EffectKind ClearanceKind();

}  // namespace torquer::effects
