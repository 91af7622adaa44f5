// Field motion: interface of the motions of a moving vessel.
#pragma once

#include <Eigen/Core>

namespace torquer::vessel {

/// Offset of the moved vessel at a point x, to second order. The point at x was at the rest
/// position xi(x) = x - offset(x).
struct Offset {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();     ///< mm
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();  ///< (i, j): d value_i / d x_j
  Eigen::Matrix3d second[3] = {Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(),
                               Eigen::Matrix3d::Zero()};  ///< Hessian of each component, 1/mm
  bool rigid = true;                                      ///< all derivatives are zero
};

/// A smooth motion of the vessel in time, periodic or not.
class FieldMotion {
 public:
  FieldMotion() = default;
  FieldMotion(const FieldMotion&) = delete;
  FieldMotion& operator=(const FieldMotion&) = delete;
  virtual ~FieldMotion() = default;

  /// Sets the time of all calls that follow, s since the start. Finite; may decrease.
  virtual void SetTime(double time_s) = 0;
  /// Adds this motion's offset at a point, up to second derivatives.
  virtual void AddOffset(const Eigen::Vector3d& point_mm, Offset& offset) const = 0;
  /// Longest way that a point of the wall has moved since the start, mm. It is an upper bound and
  /// never decreases.
  virtual double TravelMm() const = 0;
  /// Part of TravelMm() that the last call of SetTime added, mm.
  virtual double LastTravelMm() const = 0;
  /// Largest norm of the offset's jacobian at any point and time, < 1.
  virtual double LargestStretch() const = 0;
};

}  // namespace torquer::vessel
