// Rendering of an X-ray picture: attenuation, subtraction, noise, gray values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"
#include "host/simulator/effects/imaging/fluoroscopy_settings.h"
#include "host/simulator/effects/imaging/frame_taker.h"
#include "host/simulator/effects/imaging/lumen_painter.h"

namespace torquer::effects {

/// Apparent line integral at a detector for the true one, `integral`; both relative to the mean of
/// the body. `scatter_to_primary` is the ratio s of scattered to other photons at that mean. The
/// result is -ln((e^-x + s) / (1 + s)), Beer and Lambert's law with an even background.
float WithScatter(float integral, float scatter_to_primary);

/// Renders the frames of one fluoroscopy in their order, on any one thread.
class PictureRenderer {
 public:
  /// Both outlive this.
  PictureRenderer(const FluoroscopySettings& settings, const DyePoints& dye);

  void Render(const XrayFrame& frame, ImageSource::Picture& out);
  /// Mean attenuation of the last picture, which sets its exposure.
  float exposure() const { return memory_.exposure; }
  /// Continues like `twin`, the renderer of the same scene.
  void CopyFrom(const PictureRenderer& twin) { memory_ = twin.memory_; }

 private:
  // Memory that one picture passes on to the next.
  struct Memory {
    Plane body_plane;
    Plane body_smooth;  // the same without the body's tubes; empty if there are none
    Plane mask, mask_body, densest_dye;
    std::vector<float> mask_noise;
    bool has_body = false;
    View body_view;
    Eigen::Vector3d body_organs_mm = Eigen::Vector3d::Zero();
    std::int64_t body_still = 0;  // as in XrayFrame
    int fine_parts = 0;           // of the plane of a scan
    bool has_mask = false;
    Imaging mask_imaging;
    double mask_photons = 1;  // per pixel, as in Exposure
    std::int64_t mask_pedal = 0;
    std::int64_t seen_session = 0;  // of the last picture
    float exposure = 0;
  };

  void FindBody(const XrayFrame& frame);
  float FillBody(const Projection& projection, const Eigen::Vector3d& organs_mm);
  void RefineScan(const Projection& projection, std::int64_t still);
  void PaintDye(const XrayFrame& frame, const Projection& projection);
  void Subtract(const XrayFrame& frame);
  void FillWedges(const Imaging& imaging);
  void Expose(const XrayFrame& frame, ImageSource::Picture& out) const;
  static void CoverWithShutters(const Imaging& imaging, ImageSource::Picture& out);

  const FluoroscopySettings& settings_;
  const DyePoints& dye_points_;
  Memory memory_;
  // Work space.
  LumenPainter painter_;
  std::vector<LumenPoint> painted_;
  Plane devices_, dye_, scratch_;
  // The planes of the wedges depend on these alone, and most pictures repeat them.
  struct WedgeView {
    Imaging now, mask;
    bool operator==(const WedgeView&) const = default;
  };
  WedgeView wedge_view_;
  bool has_wedges_ = false;
  Plane wedges_;        // factor of the noise behind them, if the picture has_wedges_
  Plane wedges_shown_;  // their part of the shown attenuation
  std::vector<float> noise_;
};

}  // namespace torquer::effects
