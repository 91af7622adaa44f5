// Vectors that are fixed to a segment, and turn with its step (README (5)).
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "host/simulator/core/curve.h"

namespace torquer {

/// Derivative of a vector that is fixed to a segment, by the segment's step. By (5) it turns by phi
/// = [second normal, -normal] xi.
inline Frame Turning(const Frame& frame, const Eigen::Vector3d& vector) {
  Frame turning;
  turning.col(0) = frame.col(1).cross(vector);
  turning.col(1) = -frame.col(0).cross(vector);
  return turning;
}

/// Second derivative of its component along `way`: it also moves by
/// (phi (phi.vector) - vector |phi|^2)/2.
inline Eigen::Matrix2d TurningTwice(const Frame& frame, const Eigen::Vector3d& vector,
                                    const Eigen::Vector3d& way) {
  const Eigen::Vector2d by_way(frame.col(1).dot(way), -frame.col(0).dot(way));
  const Eigen::Vector2d by_vector(frame.col(1).dot(vector), -frame.col(0).dot(vector));
  Eigen::Matrix2d work = by_way * by_vector.transpose();
  work = (work + work.transpose().eval()) / 2;
  work.diagonal().array() -= way.dot(vector);
  return work;
}

}  // namespace torquer
