// A curve of straight lines and circular arcs with a continuous tangent: the axis of a tube.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>
#include <vector>

namespace torquer::vessel {

/// Piece of a path: one line or one circular arc.
///
/// On a line, the point at arc length u is start + u tangent. On an arc of radius R = 1/curvature,
/// it is start + R sin(u/R) tangent + R (1 - cos(u/R)) normal.
struct PathPiece {
  Eigen::Vector3d start_mm;
  Eigen::Vector3d tangent;      ///< unit, at the start
  Eigen::Vector3d normal;       ///< unit, orthogonal to tangent, toward the arc's center
  double curvature_per_mm = 0;  ///< 0 for a line, else > 0
  double length_mm = 0;         ///< > 0; an arc turns at most a full circle
  double begin_mm = 0;          ///< arc length of the path at which this piece begins

  Eigen::Vector3d PointAt(double u_mm) const;
  Eigen::Vector3d TangentAt(double u_mm) const;
};

/// Lines and arcs joined end to end with a continuous tangent.
class ArcLinePath {
 public:
  /// Begins an empty path at a point with a direction (normalized here; must not be zero).
  ArcLinePath(const Eigen::Vector3d& start_mm, const Eigen::Vector3d& direction);

  /// Path along a polyline, with an arc at each corner.
  ///
  /// corners_mm: at least two points, consecutive ones further apart than 1e-9 mm.
  /// bend_radius_mm: positive radius at every corner. It is reduced if the neighboring legs are too
  /// short. An arc takes at most half of a leg between two arcs. Infinity gives the largest radius
  /// that fits. Throws UserError on fewer points or a radius that is not positive. Throws it,
  /// naming the corner, on repeated points, a non-finite coordinate, or a reversal by more than 179
  /// degrees.
  static ArcLinePath FromCorners(const std::vector<Eigen::Vector3d>& corners_mm,
                                 double bend_radius_mm);

  /// Appends a line of length_mm > 0.
  ArcLinePath& Line(double length_mm);
  /// Appends an arc of radius_mm > 0 and angle_rad in (0, 2 pi]. It turns toward `toward`, which is
  /// projected orthogonal to the tangent and must not be parallel to it.
  ArcLinePath& Arc(double radius_mm, double angle_rad, const Eigen::Vector3d& toward);

  const std::vector<PathPiece>& pieces() const { return pieces_; }
  double length_mm() const { return length_mm_; }
  /// Smallest radius of curvature, mm; infinity for a straight path.
  double SmallestBendRadius() const;
  /// Arc lengths, mm, one for each corner of FromCorners: the middle of the corner's arc. The first
  /// is 0, the last is length_mm().
  const std::vector<double>& corner_arc_lengths_mm() const { return corner_arc_lengths_mm_; }

  /// Point and unit tangent at an arc length, which is clamped to [0, length_mm()].
  Eigen::Vector3d PointAt(double s_mm) const;
  Eigen::Vector3d TangentAt(double s_mm) const;

 private:
  const PathPiece& PieceAt(double s_mm) const;

  std::vector<PathPiece> pieces_;
  std::vector<double> corner_arc_lengths_mm_;
  Eigen::Vector3d end_mm_;
  Eigen::Vector3d end_tangent_;
  double length_mm_ = 0;
};

/// A unit vector orthogonal to a unit vector; it depends on the input alone.
Eigen::Vector3d AnyOrthogonal(const Eigen::Vector3d& unit);

}  // namespace torquer::vessel
