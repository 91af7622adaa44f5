// The second plane of a biplane system: another C-arm, which stands where the scene says.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"

namespace torquer::effects {

/// Takes pictures as the fluoroscopy of the scene does, with the same pedal, system and body, from
/// its own angles; noise and dose are apart.
class LateralPlane final : public Effect, public ImageSource, public Observer {
 public:
  /// `plane` has the settings of the first one. The angles are in rad, LAO and CRA positive.
  LateralPlane(std::unique_ptr<Fluoroscopy> plane, double lao_rad, double cra_rad);

  ImageSource* image() override { return this; }
  Observer* observer() override { return this; }
  void Restart() override { plane_->Restart(); }
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  /// Those of the plane's dose, with lateral_ before.
  std::vector<Reading> Readings() const override;
  bool Take(const TickView& tick) override;
  void Render(Picture& out) override { plane_->Render(out); }

 private:
  Controls From(const Controls& first) const;

  const std::unique_ptr<Fluoroscopy> plane_;
  const double lao_rad_;
  const double cra_rad_;
};

EffectKind LateralPlaneKind();

}  // namespace torquer::effects
