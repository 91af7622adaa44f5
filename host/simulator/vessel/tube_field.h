// Vessels made of tubes: exact clearance of swept centerlines and their smooth union.
//
//        wall      ______________
//   r(s) |  ______/   smooth     \____     clearance of one tube:
//  axis -+-+--- union of tubes -------       max over s of  r(s) - |p - axis(s)|
//        |________         __________/     (the envelope of spheres rolled along the axis)
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <string>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/arc_line_path.h"
#include "host/simulator/vessel/centerline.h"
#include "host/simulator/vessel/distance_source.h"

namespace torquer::vessel {

/// One tube: an axis and a radius along it. Its ends are closed by half spheres.
struct Tube {
  std::string name;
  ArcLinePath axis;
  /// Radius, mm, at each of radius_at_mm (increasing arc lengths of the axis); a single one holds
  /// everywhere. A monotone cubic with continuous slope between them, constant beyond them. The
  /// slope must stay below 0.5, and the radius below 95 % of the axis' bend radius.
  std::vector<double> radii_mm;
  std::vector<double> radius_at_mm;
};

/// Smooth union of tubes.
///
/// Within a tube, the value is the exact distance to the wall. Nearer to the axis than half the
/// smallest radius, the tip of the cone is rounded off. At junctions, values of two tubes within
/// union_width_mm of one another are blended (cubic, two continuous derivatives). This rounds the
/// edge and adds at most a sixth of the width. In and near the lumen, the gradient is continuous
/// and at most 1. The Hessian is exact and jumps between line and arc of the axis. Outside, at
/// points equally far from two parts of one tube, the gradient jumps, as for any distance.
class TubeField final : public ClearanceField, public DistanceSource {
 public:
  /// tubes: at least one. union_width_mm >= 0 (0: sharp edges, the gradient jumps there). Throws
  /// UserError naming the tube and the value.
  TubeField(const std::vector<Tube>& tubes, double union_width_mm);

  double Clearance(const Eigen::Vector3d& point_mm) const override;
  void EvaluateGradient(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  void EvaluateHessian(const Eigen::Vector3d& point_mm, ClearanceSample& out) const override;
  double LipschitzBound() const override { return 1.0 + 1e-9; }

  double Distance(const Eigen::Vector3d& point_mm) const override { return Clearance(point_mm); }
  /// Looks only at the tubes near the grid. The values are those of Clearance, bit for bit.
  void SampleGrid(const double* x, const double* y, const double* z, int count, double needed_mm,
                  double* distances) const override;

  /// Box that holds the lumen.
  const Eigen::AlignedBox3d& bounds_mm() const { return bounds_mm_; }
  double smallest_radius_mm() const { return smallest_radius_mm_; }

 private:
  // Line or arc with one cubic for the radius, in a form for look-ups.
  struct Primitive {
    bool is_arc = false;
    bool constant_radius = true;
    // Line: origin is the start, x the tangent. Arc: origin is the circle's center, x points to the
    // middle of the arc. Axis y is the tangent there, z the axis of the bend.
    Eigen::Vector3d origin, x, y, z;
    double bend_radius = 0, half_angle = 0, cos_half = 0, sin_half = 0;
    double length = 0;
    double r0 = 0, r1 = 0, r2 = 0, r3 = 0;  // radius = r0 + u (r1 + u (r2 + u r3))
    Eigen::Vector3d ball_center;
    double ball_radius = 0;  // sphere about the lumen of this primitive
  };
  struct TubeData {
    std::vector<Primitive> primitives;
    double round_mm = 0;  // distance from the axis within which the cone is rounded
    Eigen::Vector3d ball_center;
    double ball_radius = 0;
  };
  // Sphere of a tube with the largest value for a point.
  struct Contact {
    double value = 0;
    double u = 0;
    const Primitive* primitive = nullptr;
    bool interior = false;  // u is a stationary point, not an end
  };

  // Primitives of one tube that can determine its value within a ball.
  struct NearTube {
    double round_mm = 0;
    std::vector<const Primitive*> primitives;
  };

  std::vector<NearTube> FindNear(const Eigen::Vector3d& center, double radius_mm) const;
  double Blend(double value, double other) const;
  template <int kOrder>
  double Evaluate(const Eigen::Vector3d& p, ClearanceSample* out) const;
  static void Look(const Primitive& primitive, double round_mm, const Eigen::Vector3d& p,
                   Contact& best);
  template <int kOrder>
  static void Differentiate(const Contact& contact, double round_mm, const Eigen::Vector3d& p,
                            Eigen::Vector3d& gradient, Eigen::Matrix3d& hessian);
  static Primitive MakePrimitive(const PathPiece& piece, double from, double to, const Tube& tube,
                                 const std::vector<double>& slopes);

  std::vector<TubeData> tubes_;
  double union_width_mm_;
  double smallest_radius_mm_;
  Eigen::AlignedBox3d bounds_mm_;
};

/// The axis of a tube as a centerline, sampled every step_mm.
Centerline CenterlineOf(const Tube& tube, double step_mm = 0.5);

}  // namespace torquer::vessel
