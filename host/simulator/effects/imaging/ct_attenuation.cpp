#include "host/simulator/effects/imaging/ct_attenuation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace torquer::effects {

namespace {

// Mass attenuation with coherent scattering, cm^2/g, at steps of 5 keV from kLeastKeV on. The
// fractions of ICRU Report 44 and the total cross sections of xraylib 4.0 give them. At 40, 50, 60,
// 80 and 100 keV they are those of Hubbell and Seltzer, NIST 126, 2004, table 4.
constexpr double kStepKeV = 5;
using AttenuationTable = std::array<double, 13>;
constexpr AttenuationTable kWater = {0.2683, 0.2436, 0.2270, 0.2150, 0.2059, 0.1987, 0.1929,
                                     0.1879, 0.1837, 0.1799, 0.1766, 0.1735, 0.1708};
constexpr AttenuationTable kCorticalBone = {0.6655, 0.5189, 0.4242, 0.3601, 0.3148, 0.2818, 0.2570,
                                            0.2379, 0.2229, 0.2108, 0.2008, 0.1925, 0.1855};
constexpr double kWaterDensity = 1.0;  // g/cm^3
constexpr double kBoneDensity = 1.92;

constexpr double kKneeHu = 100;

// 1/mm. Between its energies the table is a power law.
double Linear(const AttenuationTable& table, double density, double keV) {
  const double steps = (keV - CtAttenuation::kLeastKeV) / kStepKeV;
  const std::size_t k = std::min(table.size() - 2, static_cast<std::size_t>(steps));
  const double low_keV = CtAttenuation::kLeastKeV + kStepKeV * static_cast<double>(k);
  const double share = std::log(keV / low_keV) / std::log1p(kStepKeV / low_keV);
  return 0.1 * density * table[k] * std::pow(table[k + 1] / table[k], share);
}

}  // namespace

CtAttenuation::CtAttenuation(double picture_keV, double ct_keV)
    : water_1_mm_(Linear(kWater, kWaterDensity, picture_keV)) {
  const double ratio =
      Linear(kCorticalBone, kBoneDensity, ct_keV) / Linear(kWater, kWaterDensity, ct_keV);
  bone_hu_ = 1000 * (ratio - 1);
  const double knee_1_mm = water_1_mm_ * (1 + kKneeHu / 1000);
  above_1_mm_ =
      (Linear(kCorticalBone, kBoneDensity, picture_keV) - knee_1_mm) / (bone_hu_ - kKneeHu);
}

double CtAttenuation::Of(double hu) const {
  if (hu <= kKneeHu) return water_1_mm_ * std::max(0.0, 1 + hu / 1000);
  return water_1_mm_ * (1 + kKneeHu / 1000) + above_1_mm_ * (hu - kKneeHu);
}

}  // namespace torquer::effects
