// Lateral plane: the second C-arm of a biplane system, at fixed angles of the scene.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy.h"

namespace torquer::effects {

/// Takes pictures like the fluoroscopy of the scene, with the same pedal, system and body, but from
/// its own angles. Noise and dose are separate.
class LateralPlane final : public Effect, public ImageSource, public Observer {
 public:
  /// `plane` has the settings of the first one. The angles are in rad, LAO and CRA positive.
  LateralPlane(std::unique_ptr<Fluoroscopy> plane, double lao_rad, double cra_rad);

  ImageSource* image() override { return this; }
  Observer* observer() override { return this; }
  void Restart() override { plane_->Restart(); }
  void CopyFrom(const Effect& twin) override;
  void Observe(const TickView& tick) override;
  /// Readings of the plane's dose, with the prefix lateral_.
  std::vector<Reading> Readings() const override;
  bool Take(const TickView& tick) override;
  bool Render(Picture& out) override { return plane_->Render(out); }

  const Fluoroscopy& plane() const { return *plane_; }
  double lao_rad() const { return lao_rad_; }
  double cra_rad() const { return cra_rad_; }

 private:
  Controls From(const Controls& first) const;

  const std::unique_ptr<Fluoroscopy> plane_;
  const double lao_rad_;
  const double cra_rad_;
};

EffectKind LateralPlaneKind();

}  // namespace torquer::effects
