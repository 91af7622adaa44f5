// The two wedge filters: semi-transparent plates at the tube, which darken bright sides of a
// picture.
#pragma once

#include <array>

#include "host/simulator/effects/effect.h"
#include "host/simulator/effects/imaging/fluoroscopy_attenuation.h"

namespace torquer::effects {

/// Shadows of both wedges in the picture.
///
/// A wedge is a plate with one straight edge, at the tube like the shutters. Its edge comes in
/// across the picture, from the left or the right if it is not turned. Its shadow thus moves with
/// the field, not with the patient. Behind the edge its attenuation rises linearly over the ramp,
/// then it is full.
class WedgeShadows {
 public:
  /// Attenuation of the full plate, 0.5 mm of copper at 60 keV (NIST: 1.593 cm^2/g, 8.96 g/cm^3).
  static constexpr double kFullIntegral = 0.05 * 1.593 * 8.96;
  /// Width of the ramp, in widths of the picture with the whole field.
  static constexpr double kRamp = 0.1;

  /// `aspect`: height of the picture over its width.
  WedgeShadows(const Imaging& imaging, double aspect);

  /// True if a wedge is in the beam.
  bool any() const { return any_; }
  /// Line integral at a place, 0 to 1 from the left and from the top of the picture.
  double IntegralAt(double column_share, double row_share) const;
  /// Fills a plane of the picture's size with the line integrals.
  void Fill(Plane& plane) const;
  /// Mean transmission of the open part of the beam, between the shutters.
  double MeanTransmission(const Imaging& imaging) const;

 private:
  // Depth of a place behind the edge, in ramps: across * column_share + down * row_share - edge.
  struct Edge {
    bool is_in = false;
    double across = 0, down = 0, edge = 0;
  };
  std::array<Edge, 2> edges_;
  bool any_ = false;
};

}  // namespace torquer::effects
