// Derivatives of an energy with respect to the points, tangents, spins and slides of a curve.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace torquer {

/// Load on a segment's tangent: derivatives with respect to the unit tangent, treated as a free
/// vector. This is a moment.
struct TangentLoad {
  int segment;
  Eigen::Vector3d gradient;  ///< mJ
  Eigen::Matrix3d hessian;   ///< mJ, symmetric; valid only if PositionDerivatives::with_hessian
};

/// Derivatives with respect to a spin: a turn of the wire about its tangent at a point. Only for a
/// wire that twists.
struct SpinLoad {
  int point;
  double gradient;                ///< mJ: minus the torque on the wire
  double hessian;                 ///< mJ
  Eigen::Vector3d with_position;  ///< N, d2 / (d spin, d position of the load)
  double before_mm = 0;           ///< distance of the load before the point, on its segment
  int instrument = 0;             ///< index in a stack of the instrument that it turns
};

/// Torque between two instruments at a segment: derivatives with respect to their relative turn.
/// Only for a stack that twists.
struct BetweenLoad {
  int segment;
  int inner;
  int outer;
  double gradient;  ///< mJ: minus the torque on the inner one, and the torque on the outer one
  double hessian;   ///< mJ
};

/// Derivatives with respect to the relative sliding of the two surfaces at a place of
/// PointSet::Between. In a lumen the sliding along it is ahead_mm, and around it
/// around.offset_mm + lever_mm turn_rad. Beside another curve, the end of `lever_mm` slides, which
/// is fixed to the inner surface.
struct SlideLoad {
  int place;
  Eigen::Vector2d around;    ///< unit, in the normals of the lumen
  Eigen::Vector2d gradient;  ///< N: along, around
  Eigen::Matrix2d hessian;   ///< N/mm, symmetric
  /// Beside another curve: from the inner axis to the contact point, in the outer surface's tangent
  /// and normals.
  Eigen::Vector3d lever_mm = Eigen::Vector3d::Zero();
};

/// Output of the energy terms on a curve. It has the derivatives by points' positions, tangents of
/// segments that bear a moment, spins, and slides in a lumen.
struct PointDerivatives {
  bool with_hessian = false;
  /// Stored derivatives of a point.
  enum Use : std::uint8_t { kNothing, kGradient, kBoth };
  std::vector<std::uint8_t> used;
  std::vector<Eigen::Vector3d> gradient;  ///< N
  std::vector<Eigen::Matrix3d> hessian;   ///< N/mm, symmetric

  /// Resizes to `size` positions, marks all as unused, and removes all loads.
  void Clear(std::size_t size) {
    used.assign(size, kNothing);
    gradient.resize(size);
    hessian.resize(size);
    on_tangents.clear();
    on_spins.clear();
    between.clear();
    in_lumen.clear();
    beside.clear();
    crossing.clear();
  }
  /// Allocates room for `size` positions.
  void Reserve(std::size_t size) {
    used.reserve(size);
    gradient.reserve(size);
    hessian.reserve(size);
  }

  /// Marks point q as used, initialized to zero. Call it before adding to the point.
  void Touch(int q) {
    if (used[q] == kBoth) return;
    if (used[q] == kNothing) gradient[q].setZero();
    if (with_hessian) hessian[q].setZero();
    used[q] = kBoth;
  }
  /// Like Touch, for a load without Hessian: a constant force.
  void TouchGradient(int q) {
    if (used[q] != kNothing) return;
    gradient[q].setZero();
    used[q] = kGradient;
  }

  std::vector<TangentLoad> on_tangents;  ///< in any order; they add up
  std::vector<SpinLoad> on_spins;        ///< as above; room for one per point
  std::vector<BetweenLoad> between;      ///< as above; room for one per segment and instrument
  std::vector<SlideLoad> in_lumen;       ///< ascending by place; room for one per place
  std::vector<SlideLoad> beside;         ///< as above
  std::vector<SlideLoad> crossing;       ///< as above
};

}  // namespace torquer
