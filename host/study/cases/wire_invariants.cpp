#include "host/study/cases/wire_invariants.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

namespace torquer::study {
namespace {

// Distance of a free wire's tip from the line of its straight part, mm.
double BendOf(const WireModel& model) {
  Eigen::Quaterniond along = Eigen::Quaterniond::Identity();
  Eigen::Vector3d tip = Eigen::Vector3d::Zero();
  for (int joint = model.first_straight_joint() - 1; joint > 0; --joint) {
    along = along * Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(),
                                                       model.rest_direction(joint));
    tip += model.segment_mm() * (along * Eigen::Vector3d::UnitZ());
  }
  return tip.head<2>().norm();
}

}  // namespace

std::string BrokenGeometry(const WireModel& model, const Curve& state) {
  std::ostringstream what;
  what.precision(17);
  const int n = state.segments();
  const double lambda = model.segment_mm();
  if (static_cast<int>(state.nodes().size()) != n + 1 ||
      static_cast<int>(state.normals().size()) != n) {
    what << "sizes differ: " << n << " tangents, " << state.nodes().size() << " nodes, "
         << state.normals().size() << " normals";
    return what.str();
  }
  if (n > model.max_segments()) what << n << " segments, more than the most. ";
  if (state.nodes()[0] != model.sheath().point_mm) what << "node 0 left the sheath. ";
  if (!std::isfinite(state.insertion_mm()) || !std::isfinite(state.rotation_rad())) {
    what << "insertion " << state.insertion_mm() << " rotation " << state.rotation_rad() << ". ";
  }
  if (!(std::abs(state.turn().norm() - 1) < 1e-12)) what << "turn is not unit. ";
  const double first = state.first_segment_mm();
  if (n > 0) {
    if (!(first > 0.499999 * lambda && first < 1.500001 * lambda)) {
      what << "first segment " << first << " of " << lambda << ". ";
    }
    if (!(std::abs(state.ArcLength(model) - state.insertion_mm()) < 1e-9 * (1 + n * lambda))) {
      what << "arc length " << state.ArcLength(model) << " for insertion " << state.insertion_mm()
           << ". ";
    }
  } else if (!(state.insertion_mm() >= 0 && state.insertion_mm() < lambda)) {
    what << "no segment at insertion " << state.insertion_mm() << ". ";
  }
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    const Eigen::Vector3d& u = state.tangents()[k];
    const Eigen::Vector3d& normal = state.normals()[k];
    const double length = (state.nodes()[k + 1] - state.nodes()[k]).norm();
    // Written so that NaN counts as broken.
    const bool fine = std::abs(u.norm() - 1) < 1e-12 && std::abs(normal.norm() - 1) < 1e-9 &&
                      std::abs(normal.dot(u)) < 1e-9 &&
                      std::abs(length - state.SegmentLength(model, i)) < 1e-9 &&
                      state.nodes()[k + 1].allFinite();
    if (!fine) {
      what << "segment " << i << " of " << n << ": |u| - 1 = " << u.norm() - 1
           << ", |normal| - 1 = " << normal.norm() - 1 << ", normal.u = " << normal.dot(u)
           << ", length " << length << " for " << state.SegmentLength(model, i) << ". ";
      break;
    }
  }
  for (const Eigen::Vector2d& twist : state.reference_twist()) {
    if (!(std::abs(twist.norm() - 1) < 1e-6)) {
      what << "reference twist of length " << twist.norm() << ". ";
      break;
    }
  }
  return what.str();
}

TickChecker::TickChecker(const WireModel& model, const ClearanceField& field,
                         const WireState& before)
    : model_(model), field_(field), bend_mm_(BendOf(model)) {
  Remember(before);
}

std::string TickChecker::Check(const InstrumentPoses& target, const TickReport& report,
                               const WireState& state, int points_per_segment) {
  std::ostringstream what;
  what.precision(17);
  what << BrokenGeometry(model_, state);
  if (!std::isfinite(report.energy_mJ) || !std::isfinite(report.residual) ||
      !std::isfinite(report.max_penetration_mm) || !std::isfinite(report.carried[0].insertion_mm)) {
    what << "report: energy " << report.energy_mJ << ", residual " << report.residual
         << ", penetration " << report.max_penetration_mm << ", carried "
         << report.carried[0].insertion_mm << ". ";
  }
  if (report.energy_mJ < -1e-12) what << "energy " << report.energy_mJ << ". ";
  const double asked = std::min(std::max(target[0].insertion_mm, 0.0), model_.max_length_mm());
  if (!(std::abs(asked - state.insertion_mm() - report.carried[0].insertion_mm) < 1e-9)) {
    what << "asked " << asked << ", inserted " << state.insertion_mm() << ", carried "
         << report.carried[0].insertion_mm << ". ";
  }
  const double penetration = DeepestPenetration(state, points_per_segment);
  if (!(std::abs(penetration - report.max_penetration_mm) < 1e-9 * (1 + penetration))) {
    what << "penetration " << penetration << " reported as " << report.max_penetration_mm << ". ";
  }
  // Sliding along itself and turning, the wire can move the tip at most this far. A reported snap
  // must be larger. A motion of more than four times this plus two lumens must be reported.
  const double turn_rad = std::abs(state.rotation_rad() - rotation_rad_);
  const double explained = std::abs(state.insertion_mm() - insertion_mm_) +
                           2 * bend_mm_ * std::sin(std::min(turn_rad, std::numbers::pi) / 2);
  const double tip = (state.nodes().back() - tip_).norm();
  if (tip > 4 * explained + 20 && !report.snapped) {
    what << "the tip moved " << tip << " mm, the hand explains " << explained
         << " mm, and no snap was reported. ";
  }
  if (tip <= explained && report.snapped) {
    what << "the tip moved " << tip << " mm, the hand explains " << explained
         << " mm, and a snap was reported. ";
  }
  if (tip > insertion_mm_ + state.insertion_mm() + 1e-9) {
    what << "the tip went " << tip << ", farther than the wire is long. ";
  }
  Remember(state);
  return what.str();
}

double TickChecker::DeepestPenetration(const WireState& state, int points_per_segment) const {
  double deepest = 0;
  const int n = state.segments();
  for (int i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    for (int part = 1; part <= points_per_segment; ++part) {
      const Eigen::Vector3d at =
          part == points_per_segment
              ? state.nodes()[k + 1]
              : Eigen::Vector3d(state.nodes()[k] +
                                (state.SegmentLength(model_, i) * part / points_per_segment) *
                                    state.tangents()[k]);
      deepest = std::max(deepest, model_.radius_mm(n - 1 - i) - field_.Clearance(at));
    }
  }
  return deepest;
}

void TickChecker::Remember(const WireState& state) {
  tip_ = state.nodes().back();
  insertion_mm_ = state.insertion_mm();
  rotation_rad_ = state.rotation_rad();
}

}  // namespace torquer::study
