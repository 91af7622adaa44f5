#include "host/viewer/vessel_motion.h"

namespace torquer::viewer {
namespace {

bool AtEnd(std::size_t corner, std::size_t motion) { return (corner >> motion & 1U) != 0; }

// Position of the point at a corner: x = X + sum of way w(x). The iteration contracts, because
// motions do not fold the vessel (effects::kMostStretch).
Eigen::Vector3d AtCorner(const Motions& motions, const Eigen::Vector3d& at_rest_mm,
                         std::size_t corner) {
  constexpr int kMostRounds = 100;
  constexpr double kEnoughMm = 1e-6;
  Eigen::Vector3d place = at_rest_mm;
  for (int round = 0; round < kMostRounds; ++round) {
    Eigen::Vector3d next = at_rest_mm;
    for (std::size_t k = 0; k < motions.size(); ++k) {
      if (AtEnd(corner, k)) next += motions[k]->WeightAt(place) * motions[k]->settings().way_mm;
    }
    const bool enough = (next - place).squaredNorm() < kEnoughMm * kEnoughMm;
    place = next;
    if (enough) break;
  }
  return place;
}

}  // namespace

Motions MotionsOf(const scene::Scene& scene) {
  Motions motions;
  for (const auto& effect : scene.effects()) {
    const auto* motion = dynamic_cast<const effects::PeriodicMotion*>(effect.get());
    if (motion != nullptr) motions.push_back(motion);
  }
  return motions;
}

std::vector<Shares> SharesOf(const Motions& motions,
                             const std::vector<Eigen::Vector3d>& points_mm) {
  std::vector<Shares> shares(motions.size());
  const std::size_t corners = std::size_t{1} << motions.size();
  for (Shares& one : shares) one.reserve(corners * points_mm.size());
  for (const Eigen::Vector3d& point : points_mm) {
    for (std::size_t corner = 0; corner < corners; ++corner) {
      const Eigen::Vector3d place = AtCorner(motions, point, corner);
      for (std::size_t k = 0; k < motions.size(); ++k) {
        shares[k].push_back(static_cast<float>(motions[k]->WeightAt(place)));
      }
    }
  }
  return shares;
}

Eigen::Vector3d Moved(const Eigen::Vector3d& at_rest_mm, const Motions& motions,
                      const std::vector<Shares>& shares, std::size_t point,
                      const std::vector<double>& pulses) {
  const std::size_t corners = std::size_t{1} << motions.size();
  Eigen::Vector3d moved = at_rest_mm;
  for (std::size_t corner = 0; corner < corners; ++corner) {
    double part = 1;
    for (std::size_t k = 0; k < motions.size(); ++k) {
      part *= AtEnd(corner, k) ? pulses[k] : 1 - pulses[k];
    }
    for (std::size_t k = 0; k < motions.size(); ++k) {
      moved += part * pulses[k] * static_cast<double>(shares[k][corners * point + corner]) *
               motions[k]->settings().way_mm;
    }
  }
  return moved;
}

}  // namespace torquer::viewer
