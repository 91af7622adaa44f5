// Analytic fields: small vessels with closed-form clearance, for which equilibria can be written
// down.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "host/simulator/core/clearance_field.h"

namespace torquer::study {

/// Field that computes value, gradient and Hessian in one function.
class AnalyticField : public ClearanceField {
 public:
  double Clearance(const Eigen::Vector3d& point_mm) const override {
    ClearanceSample sample;
    EvaluateHessian(point_mm, sample);
    return sample.clearance_mm;
  }
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override {
    ClearanceSample sample;
    EvaluateHessian(point_mm, sample);
    out.clearance_mm = sample.clearance_mm;
    out.gradient = sample.gradient;
  }
  double LipschitzBound() const override { return 1; }
};

/// Free space: no wall within reach.
class FreeSpace final : public AnalyticField {
 public:
  void EvaluateHessian(const Eigen::Vector3d&, ClearanceSample& out) const override {
    out = ClearanceSample();
    out.clearance_mm = 1e6;
  }
};

/// Plane wall; the lumen is on the side to which `normal` (unit) points.
class HalfSpace final : public AnalyticField {
 public:
  HalfSpace(const Eigen::Vector3d& point, const Eigen::Vector3d& normal)
      : point_(point), normal_(normal) {}
  void EvaluateHessian(const Eigen::Vector3d& p, ClearanceSample& out) const override {
    out.clearance_mm = (p - point_).dot(normal_);
    out.gradient = normal_;
    out.hessian.setZero();
  }

 private:
  Eigen::Vector3d point_;
  Eigen::Vector3d normal_;
};

/// Side of a round wall on which the lumen is.
enum class Side { kInside, kOutside };

/// Wall at a distance `radius_mm` from a straight line, a ring or a line segment.
class RoundWall : public AnalyticField {
 public:
  RoundWall(Side side, double radius_mm)
      : sign_(side == Side::kInside ? -1 : 1), radius_mm_(radius_mm) {}

 protected:
  // Computes a sample from the offset w to the nearest point of the axis. `moves` is the derivative
  // of w with respect to the point.
  void FromOffset(const Eigen::Vector3d& w, const Eigen::Matrix3d& moves,
                  ClearanceSample& out) const {
    const double d = std::max(w.norm(), 1e-12);
    const Eigen::Vector3d g = w / d;
    out.clearance_mm = sign_ * (d - radius_mm_);
    out.gradient = sign_ * g;
    out.hessian = (sign_ / d) * (moves - g * g.transpose());
  }
  double sign_;
  double radius_mm_;
};

/// A straight tube (inside) or a post (outside).
class Cylinder final : public RoundWall {
 public:
  Cylinder(Side side, const Eigen::Vector3d& point, const Eigen::Vector3d& axis, double radius_mm)
      : RoundWall(side, radius_mm), point_(point), axis_(axis.normalized()) {}
  void EvaluateHessian(const Eigen::Vector3d& p, ClearanceSample& out) const override {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis_ * axis_.transpose();
    FromOffset(across * (p - point_), across, out);
  }

 private:
  Eigen::Vector3d point_;
  Eigen::Vector3d axis_;
};

/// A torus about the z axis, its ring of radius `ring_mm` in the plane z = 0.
class Torus final : public RoundWall {
 public:
  Torus(Side side, double ring_mm, double radius_mm) : RoundWall(side, radius_mm), ring_(ring_mm) {}
  void EvaluateHessian(const Eigen::Vector3d& p, ClearanceSample& out) const override {
    const double rho = std::max(std::hypot(p[0], p[1]), 1e-12);
    const Eigen::Vector3d e(p[0] / rho, p[1] / rho, 0);
    const Eigen::Vector3d around(-e[1], e[0], 0);
    const Eigen::Matrix3d moves =
        Eigen::Matrix3d::Identity() - (ring_ / rho) * around * around.transpose();
    FromOffset((rho - ring_) * e + p[2] * Eigen::Vector3d::UnitZ(), moves, out);
  }

 private:
  double ring_;
};

/// A tube from a to b closed by half spheres: a blind end.
class Capsule final : public RoundWall {
 public:
  Capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius_mm)
      : RoundWall(Side::kInside, radius_mm), a_(a), b_(b) {}
  void EvaluateHessian(const Eigen::Vector3d& p, ClearanceSample& out) const override {
    const Eigen::Vector3d ab = b_ - a_;
    const double t = (p - a_).dot(ab) / ab.squaredNorm();
    const double at = std::clamp(t, 0.0, 1.0);
    Eigen::Matrix3d moves = Eigen::Matrix3d::Identity();
    if (t == at) moves -= ab * ab.transpose() / ab.squaredNorm();
    FromOffset(p - a_ - at * ab, moves, out);
  }

 private:
  Eigen::Vector3d a_;
  Eigen::Vector3d b_;
};

}  // namespace torquer::study
