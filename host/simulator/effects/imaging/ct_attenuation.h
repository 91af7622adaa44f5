// Attenuation of X-rays by tissue that a CT shows.
#pragma once

namespace torquer::effects {

/// From Hounsfield units (HU) to linear attenuation at the effective energy of a picture.
///
/// Up to 100 HU tissue is scaled water. This holds within 1 % for soft tissue and blood from 50 to
/// 80 keV, and within 5 % for fat. Above, a line leads to cortical bone (ICRU-44), because calcium
/// attenuates slow photons more than water does. The HU of that bone follow from the effective
/// energy of the CT.
class CtAttenuation {
 public:
  static constexpr double kLeastKeV = 40, kMostKeV = 100;

  /// Effective energies of the picture and of the CT, kLeastKeV to kMostKeV.
  CtAttenuation(double picture_keV, double ct_keV);

  /// 1/mm, >= 0.
  double Of(double hu) const;
  /// HU of cortical bone in the CT.
  double bone_hu() const { return bone_hu_; }

 private:
  double water_1_mm_;
  double bone_hu_;
  double above_1_mm_;  // per HU above the knee
};

}  // namespace torquer::effects
