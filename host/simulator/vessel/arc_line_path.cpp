#include "host/simulator/vessel/arc_line_path.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "host/support/error.h"

namespace torquer::vessel {

using Eigen::Vector3d;

Vector3d AnyOrthogonal(const Vector3d& unit) {
  int least = 0;
  unit.cwiseAbs().minCoeff(&least);
  return unit.cross(Vector3d::Unit(least)).normalized();
}

Vector3d PathPiece::PointAt(double u_mm) const {
  if (curvature_per_mm == 0) return start_mm + u_mm * tangent;
  const double angle = u_mm * curvature_per_mm;
  return start_mm + (std::sin(angle) * tangent + (1 - std::cos(angle)) * normal) / curvature_per_mm;
}

Vector3d PathPiece::TangentAt(double u_mm) const {
  const double angle = u_mm * curvature_per_mm;
  return std::cos(angle) * tangent + std::sin(angle) * normal;
}

ArcLinePath::ArcLinePath(const Vector3d& start_mm, const Vector3d& direction)
    : end_mm_(start_mm), end_tangent_(direction.normalized()) {
  assert(start_mm.allFinite() && end_tangent_.allFinite() && direction.norm() > 0);
}

ArcLinePath& ArcLinePath::Line(double length_mm) {
  assert(length_mm > 0);
  pieces_.push_back({end_mm_, end_tangent_, AnyOrthogonal(end_tangent_), 0, length_mm, length_mm_});
  end_mm_ += length_mm * end_tangent_;
  length_mm_ += length_mm;
  return *this;
}

ArcLinePath& ArcLinePath::Arc(double radius_mm, double angle_rad, const Vector3d& toward) {
  assert(radius_mm > 0 && angle_rad > 0);
  const Vector3d normal = (toward - toward.dot(end_tangent_) * end_tangent_).normalized();
  assert(normal.allFinite());
  PathPiece piece{end_mm_, end_tangent_, normal, 1 / radius_mm, radius_mm * angle_rad, length_mm_};
  end_mm_ = piece.PointAt(piece.length_mm);
  end_tangent_ = piece.TangentAt(piece.length_mm).normalized();
  length_mm_ += piece.length_mm;
  pieces_.push_back(piece);
  return *this;
}

ArcLinePath ArcLinePath::FromCorners(const std::vector<Vector3d>& corners_mm,
                                     double bend_radius_mm) {
  const size_t count = corners_mm.size();
  if (count < 2) {
    throw UserError("a tube's axis has " + std::to_string(count) +
                    " point(s); give at least two corners");
  }
  if (!(bend_radius_mm > 0)) {
    throw UserError("a tube's bend radius is " + std::to_string(bend_radius_mm) +
                    " mm; give a radius above 0");
  }
  std::vector<Vector3d> legs;
  for (size_t i = 0; i < count; ++i) {
    if (!corners_mm[i].allFinite()) {
      throw UserError("corner " + std::to_string(i) +
                      " of a tube's axis is not finite; give three finite coordinates in mm");
    }
    if (i == 0) continue;
    legs.emplace_back(corners_mm[i] - corners_mm[i - 1]);
    if (legs.back().norm() < 1e-9) {
      throw UserError("corners " + std::to_string(i - 1) + " and " + std::to_string(i) +
                      " of a tube's axis are the same point; remove one");
    }
  }
  ArcLinePath path(corners_mm.front(), legs.front());
  path.corner_arc_lengths_mm_.push_back(0);
  double used = 0;  // part of the current leg that the arc at its start uses
  for (size_t i = 0; i < legs.size(); ++i) {
    const double leg = legs[i].norm();
    if (i + 1 == legs.size()) {
      if (leg - used > 1e-9) path.Line(leg - used);
      break;
    }
    const Vector3d direction = legs[i] / leg;
    const Vector3d next = legs[i + 1].normalized();
    const double turn = std::atan2(direction.cross(next).norm(), direction.dot(next));
    if (turn > 179.0 / 180.0 * M_PI) {
      throw UserError("the axis of a tube turns back on itself at corner " + std::to_string(i + 1) +
                      "; move the corner so that it turns by less than 179 degrees");
    }
    // A leg is shared by the arcs at its two ends; the outermost legs serve one arc alone.
    const double room = std::min(
        i == 0 ? leg : leg / 2, i + 2 == legs.size() ? legs[i + 1].norm() : legs[i + 1].norm() / 2);
    const double half_tangent = std::tan(turn / 2);
    double setback = 0;
    if (turn > 1e-9) setback = std::min(bend_radius_mm * half_tangent, room);
    if (leg - used - setback > 1e-9) path.Line(leg - used - setback);
    if (turn > 1e-9) {
      path.Arc(setback / half_tangent, turn, next);
      path.corner_arc_lengths_mm_.push_back(path.length_mm_ - path.pieces_.back().length_mm / 2);
    } else {
      path.corner_arc_lengths_mm_.push_back(path.length_mm_);
    }
    used = setback;
  }
  path.corner_arc_lengths_mm_.push_back(path.length_mm_);
  return path;
}

double ArcLinePath::SmallestBendRadius() const {
  double largest = 0;
  for (const PathPiece& piece : pieces_) largest = std::max(largest, piece.curvature_per_mm);
  return largest > 0 ? 1 / largest : std::numeric_limits<double>::infinity();
}

const PathPiece& ArcLinePath::PieceAt(double s_mm) const {
  assert(!pieces_.empty());
  auto after = std::upper_bound(pieces_.begin(), pieces_.end(), s_mm,
                                [](double s, const PathPiece& p) { return s < p.begin_mm; });
  return after == pieces_.begin() ? pieces_.front() : *(after - 1);
}

Vector3d ArcLinePath::PointAt(double s_mm) const {
  const double s = std::clamp(s_mm, 0.0, length_mm_);
  const PathPiece& piece = PieceAt(s);
  return piece.PointAt(std::min(s - piece.begin_mm, piece.length_mm));
}

Vector3d ArcLinePath::TangentAt(double s_mm) const {
  const double s = std::clamp(s_mm, 0.0, length_mm_);
  const PathPiece& piece = PieceAt(s);
  return piece.TangentAt(std::min(s - piece.begin_mm, piece.length_mm));
}

}  // namespace torquer::vessel
