// A vessel that moves: what those who move it must answer.
#pragma once

#include <Eigen/Core>

namespace torquer::vessel {

/// Where a point of the moved vessel came from, to second order about a point x: the vessel's own
/// point xi(x) = x - offset(x).
struct Offset {
  Eigen::Vector3d value = Eigen::Vector3d::Zero();     ///< mm
  Eigen::Matrix3d jacobian = Eigen::Matrix3d::Zero();  ///< (i, j): d value_i / d x_j
  Eigen::Matrix3d second[3] = {Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero(),
                               Eigen::Matrix3d::Zero()};  ///< Hessian of each component, 1/mm
  bool rigid = true;  ///< no derivative of it is anything but zero
};

/// A smooth motion of the vessel in time, periodic or not.
class FieldMotion {
 public:
  FieldMotion() = default;
  FieldMotion(const FieldMotion&) = delete;
  FieldMotion& operator=(const FieldMotion&) = delete;
  virtual ~FieldMotion() = default;

  /// The time, s since the start, of all that is asked next. Finite; need not ascend.
  virtual void SetTime(double time_s) = 0;
  /// Adds this motion's offset at a point, up to second derivatives.
  virtual void AddOffset(const Eigen::Vector3d& point_mm, Offset& offset) const = 0;
  /// Length of the longest way that a place of the wall has gone since the start, mm (an upper
  /// bound; never falls).
  virtual double TravelMm() const = 0;
  /// Largest norm of the offset's jacobian that occurs, < 1.
  virtual double LargestStretch() const = 0;
};

}  // namespace torquer::vessel
