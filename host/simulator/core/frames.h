// Frames of the cross-section, carried along a wire and in time (README, section 3).
#pragma once

#include <Eigen/Core>

namespace torquer {

/// Carries a unit vector across unit `from` to one across unit `to`. It uses the smallest rotation
/// that takes `from` to `to` (README (10)). For opposite tangents it rotates by half a turn about
/// the vector itself.
Eigen::Vector3d ParallelTransport(const Eigen::Vector3d& normal, const Eigen::Vector3d& from,
                                  const Eigen::Vector3d& to);

/// Turn of a joint's frames, as cosine and sine of an angle about `to`. The angle is counted
/// backwards from `to_normal` to `normal`, carried there from `from` by parallel transport (README
/// (11)).
Eigen::Vector2d FrameTurn(const Eigen::Vector3d& from, const Eigen::Vector3d& normal,
                          const Eigen::Vector3d& to, const Eigen::Vector3d& to_normal);

/// A unit vector turned about a unit tangent that it is across to.
Eigen::Vector3d TurnedAbout(const Eigen::Vector3d& tangent, const Eigen::Vector3d& normal,
                            double angle_rad);

/// `v` turned by an angle; `turn` is its cosine and sine. Turns multiply like complex numbers.
inline Eigen::Vector2d Turned(const Eigen::Vector2d& v, const Eigen::Vector2d& turn) {
  return {turn[0] * v[0] - turn[1] * v[1], turn[1] * v[0] + turn[0] * v[1]};
}

}  // namespace torquer
