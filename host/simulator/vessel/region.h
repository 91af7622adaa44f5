// Region: a part of the vessel with a soft edge, as a smooth weight.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/vessel/centerline.h"

namespace torquer::vessel {

/// A weight and its derivatives at a point.
struct RegionWeight {
  double value = 0;                                    ///< 0 .. 1
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();  ///< 1/mm
  Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();   ///< 1/mm^2
};

/// A function of space with two continuous derivatives: 1 in the region, 0 beyond its edge.
class Region {
 public:
  /// 1 within `radius_mm` (>= 0) of a point, falling to 0 over `edge_mm` (> 0).
  static Region Ball(const Eigen::Vector3d& center_mm, double radius_mm, double edge_mm);
  /// As Ball, about every place of a curve from one arc length to another, mm (from < to). The edge
  /// begins up to 3.5 % of the radius further out.
  static Region Stretch(const Centerline& curve, double from_mm, double to_mm, double radius_mm,
                        double edge_mm);
  /// Half space to which `direction` (unit) points: 0 at the plane through point_mm, 1 from
  /// `edge_mm` (> 0) beyond it.
  static Region Side(const Eigen::Vector3d& point_mm, const Eigen::Vector3d& direction,
                     double edge_mm);

  double Weight(const Eigen::Vector3d& point_mm) const;
  /// Weight and derivatives. Returns false and does not write `out` if all of them are zero.
  bool Evaluate(const Eigen::Vector3d& point_mm, RegionWeight& out) const;
  /// Upper bound of the gradient's length, 1/mm.
  double SteepestSlope() const;

  /// True if a point with a weight above 1/2 was found in the lumen (clearance > 0). Searches the
  /// centerlines and grids about the region's balls; for a side, a grid in `bounds_mm`.
  /// `comparisons`, unless null, receives the number of comparisons of a point with a group of
  /// balls. Along a stretch, it grows with the length.
  bool MeetsLumen(const ClearanceField& field, const CenterlineNetwork& centerlines,
                  const Eigen::AlignedBox3d& bounds_mm, std::int64_t* comparisons = nullptr) const;

 private:
  Region(double radius_mm, double edge_mm) : radius_mm_(radius_mm), edge_mm_(edge_mm) {}
  void Group();

  // Consecutive balls along a curve, with one that contains them all.
  struct BallGroup {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    double reach_mm = 0;
    std::size_t first = 0;
    std::size_t end = 0;
  };

  double WeightAmong(const std::vector<BallGroup>& groups, const Eigen::Vector3d& point_mm) const;
  bool BallMeetsLumen(std::size_t ball, const ClearanceField& field,
                      std::int64_t& comparisons) const;

  double OuterMm() const { return radius_mm_ + edge_mm_; }

  double radius_mm_;
  double edge_mm_;
  std::vector<Eigen::Vector3d> centers_;  // empty for a side
  std::vector<BallGroup> groups_;
  int most_overlapping_ = 1;
  Eigen::Vector3d point_ = Eigen::Vector3d::Zero();      // of a side
  Eigen::Vector3d direction_ = Eigen::Vector3d::Zero();  // of a side
};

}  // namespace torquer::vessel
