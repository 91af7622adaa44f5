#include "host/simulator/core/frames.h"

#include <Eigen/Geometry>
#include <cmath>

namespace torquer {

using Eigen::Vector3d;

Vector3d ParallelTransport(const Vector3d& normal, const Vector3d& from, const Vector3d& to) {
  const double one_plus_cos = 1 + from.dot(to);
  if (one_plus_cos < 1e-12) return normal;
  // Rotation about from x to, in a form without trigonometry; valid because normal is across from.
  const Vector3d carried = normal - (normal.dot(to) / one_plus_cos) * (from + to);  // (10)
  // Removes the rounding errors along `to` and in the length, so that they do not accumulate.
  const Vector3d across = carried - carried.dot(to) * to;
  if (one_plus_cos < 0.1) return across.normalized();  // rounding errors are large here
  return across * (1.5 - 0.5 * across.squaredNorm());
}

Eigen::Vector2d FrameTurn(const Vector3d& from, const Vector3d& normal, const Vector3d& to,
                          const Vector3d& to_normal) {
  const double one_plus_cos = 1 + from.dot(to);
  const Vector3d carried =
      one_plus_cos < 1e-12 ? normal : normal - (normal.dot(to) / one_plus_cos) * (from + to);
  return {carried.dot(to_normal), carried.dot(to.cross(to_normal))};
}

Vector3d TurnedAbout(const Vector3d& tangent, const Vector3d& normal, double angle_rad) {
  return std::cos(angle_rad) * normal + std::sin(angle_rad) * tangent.cross(normal);
}

}  // namespace torquer
