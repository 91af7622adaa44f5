// Energy term: the interface by which an effect adds to the energy of the wire.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/frames.h"
#include "host/simulator/core/instrument_pose.h"

namespace torquer {

/// Place at which a curve lies beside the lumen wall of a curve around it, or beside another curve
/// (README, section 18). The lumen is then the surface of that other curve. All fields are
/// functions of the state; friction in the lumen depends on their changes. The first normal of a
/// surface is fixed to the material of an instrument that twists. Otherwise it is fixed to the
/// segment.
struct LumenContact {
  int inner = 0;           ///< instrument whose surface faces the lumen's wall
  int outer = 0;           ///< instrument whose lumen it is
  int outer_from_tip = 0;  ///< segment of the outer curve at the foot, counted from its tip
  double lever_mm = 0;     ///< radius of the inner one; minus that radius beside the outer one
  double lumen_mm = 0;     ///< radius of the lumen
  double force_N = 0;      ///< contact force between the curves; 0 without contact
  /// Position of the inner instrument's material along that of the outer one, up to a constant.
  double ahead_mm = 0;
  /// Offset of the inner curve from the outer one, across it, in the first and second normal of the
  /// lumen.
  Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();
  double turn_rad = 0;  ///< from the first normal of the lumen to that of the inner surface
};

/// Points of a curve at which wall and effects act: K per segment, at fractions 1/K .. 1 of it.
/// Point q belongs to segment q / K. All arrays have one entry per point. Without room in a lumen,
/// all instruments are on curve 0.
struct PointSet {
  int per_segment = 1;                    ///< K
  std::vector<Eigen::Vector3d> position;  ///< mm
  /// Length of wire that the point stands for: half of the piece before it and half of the piece
  /// after it. So the last point has half a piece, and the sheath has the first half piece.
  std::vector<double> weight_mm;
  std::vector<double> radius_mm;           ///< of the wire there
  std::vector<std::uint8_t> touches;       ///< 1 where the wire's surface is beyond the wall
  std::vector<int> near;                   ///< the points that touch or nearly do, ascending
  std::vector<ClearanceSample> clearance;  ///< valid only at `near` points
  std::vector<double> stiffness_N_mm2;     ///< of the wall; valid only at `near` points
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  ///< mm; start of the piece of point 0
  /// Normals of a curve that twists and, for a stack, the angle of each instrument on it against
  /// them.
  struct Turns {
    /// One per segment: unit, across it; for a lone wire, fixed to its material. Empty if nothing
    /// twists.
    std::vector<Eigen::Vector3d> normals;
    /// One per segment; empty for a lone wire.
    std::vector<std::array<double, kMostInstruments>> angles_rad;
  };
  Turns turns;
  int curve = 0;             ///< number of the curve, from the innermost
  int first_instrument = 0;  ///< the innermost on the curve
  int last_instrument = 1;   ///< one past the outermost on the curve
  /// Number of points, from the sheath on, that lie in the lumen of another curve. They cannot
  /// touch the wall.
  int in_lumen = 0;
  /// For curves around others: radius of the curve inside at the same way from the sheath, 0 beyond
  /// its end. Otherwise empty.
  std::vector<double> inside_mm;
  bool is_farthest = true;        ///< the curve reaches farthest; of equals, the innermost
  double behind_farthest_mm = 0;  ///< distance of the curve's end behind that of the farthest one
  bool beside_farthest = false;   ///< the curve lies beside the farthest one, not within or around
  /// Contact force of each instrument against the next one around it, N; one entry per segment.
  /// Only for a stack that twists, only if a term has EnergyTerm::SlidingBetween. Updated when a
  /// part of the motion begins.
  std::vector<std::array<double, kMostInstruments>> pressed_N;
  /// For a curve with another one around it, if a term has EnergyTerm::SlidesInLumen: the places in
  /// the lumen, `lumen_per_segment` for each segment, from the sheath to the mouth or the tip.
  /// Otherwise empty.
  std::vector<LumenContact> lumen;
  /// Same for the places beside another curve of a higher number. A place that faces nothing has no
  /// force.
  std::vector<LumenContact> beside;
  int lumen_per_segment = 2;
  std::array<double, kMostInstruments> behind_mm =
      {};                 ///< distance of the tip of each instrument on the curve behind its end
  double spacing_mm = 1;  ///< distance between points, lambda / K
  double first_spacing_mm = 1;  ///< distance between points of the first segment

  int size() const { return static_cast<int>(position.size()); }
  int segments() const { return size() / per_segment; }
  /// Index of the point in the material: constant while the wire moves through the sheath.
  int FromTip(int q) const { return size() - 1 - q; }
  /// Normal of the segment of point q, fixed to the material of an instrument.
  Eigen::Vector3d NormalOf(int instrument, int q) const {
    const auto i = static_cast<std::size_t>(q / per_segment);
    if (turns.angles_rad.empty()) return turns.normals[i];
    return TurnedAbout(Tangent(q), turns.normals[i],
                       turns.angles_rad[i][static_cast<std::size_t>(instrument)]);
  }
  /// Normal, as of NormalOf, of the surface that touches the wall at the point.
  Eigen::Vector3d Normal(int q) const { return NormalOf(SurfaceAt(q), q); }
  /// The outermost instrument of the curve that reaches the point; its surface touches the wall.
  int SurfaceAt(int q) const {
    int k = last_instrument - 1;
    while (k > first_instrument &&
           behind_mm[static_cast<std::size_t>(k)] > FromTip(q) * spacing_mm) {
      --k;
    }
    return k;
  }
  /// Distance of the point from the tip of that instrument, mm.
  double FromTipOf(int instrument, int q) const {
    return FromTip(q) * spacing_mm - behind_mm[static_cast<std::size_t>(instrument)];
  }
  /// Fraction of the point's length that the instrument covers, 0 .. 1: between 0 and 1 only near
  /// its tip.
  double CoverageOf(int instrument, int q) const {
    const double before_mm = PieceMm(q) / 2;
    const double beyond_mm = q + 1 < size() ? PieceMm(q + 1) / 2 : 0;
    const double from_tip_mm = FromTipMm(q) - behind_mm[static_cast<std::size_t>(instrument)];
    const double reached_mm = std::clamp(from_tip_mm, -before_mm, beyond_mm);
    return (before_mm + reached_mm) / (before_mm + beyond_mm);
  }
  /// Distance of the point from the distal end, mm.
  double FromTipMm(int q) const {
    const int in_first =
        std::max(0, per_segment - 1 - q);  // pieces with the first segment's spacing
    return (FromTip(q) - in_first) * spacing_mm + in_first * first_spacing_mm;
  }
  /// The length of the piece that ends in the point, mm.
  double PieceMm(int q) const { return q < per_segment ? first_spacing_mm : spacing_mm; }
  /// The unit tangent of the segment that the point belongs to.
  Eigen::Vector3d Tangent(int q) const {
    const auto p = static_cast<std::size_t>(q);
    return (position[p] - (q == 0 ? start : position[p - 1])) / PieceMm(q);
  }

  /// Place between points: on the piece that ends in `point`, `before_mm` before that point.
  struct Place {
    int point;         ///< negative: past the sheath
    double before_mm;  ///< negative: beyond the point, on the line of its piece
  };
  /// Place at a distance from the distal end, >= 0. Snaps to a point within rounding.
  Place PlaceAt(double from_tip_mm) const {
    const double in_first_mm = from_tip_mm - (size() - per_segment) * spacing_mm;
    return in_first_mm > kRoundingMm ? PlaceOn(per_segment - 1, in_first_mm, first_spacing_mm)
                                     : PlaceOn(size() - 1, from_tip_mm, spacing_mm);
  }
  Eigen::Vector3d PositionAt(const Place& place) const {
    const Eigen::Vector3d& end = position[static_cast<std::size_t>(place.point)];
    if (place.before_mm == 0) return end;
    return end - place.before_mm * Tangent(place.point);
  }

 private:
  static constexpr double kRoundingMm = 1e-9;
  static Place PlaceOn(int last_point, double before_mm, double piece_mm) {
    const int pieces = static_cast<int>((before_mm + kRoundingMm) / piece_mm);
    const double rest_mm = before_mm - pieces * piece_mm;
    return {last_point - pieces, rest_mm > kRoundingMm ? rest_mm : 0};
  }
};

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
/// PointSet::lumen or PointSet::beside. The sliding along the lumen is ahead_mm; around it,
/// around.offset_mm + lever_mm turn_rad.
struct SlideLoad {
  int place;
  Eigen::Vector2d around;    ///< unit, in the normals of the lumen
  Eigen::Vector2d gradient;  ///< N: along, around
  Eigen::Matrix2d hessian;   ///< N/mm, symmetric
};

/// Output of the energy terms on a curve: derivatives with respect to positions of points, to
/// tangents of segments that bear a moment, to spins, and to slides in a lumen.
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
  }
  /// Allocates room for `size` positions.
  void Reserve(std::size_t size) {
    used.reserve(size);
    gradient.reserve(size);
    hessian.reserve(size);
  }

  /// Marks point q as used, initialized to zero. Call it before adding to the point.
  void Touch(int q) {
    const auto k = static_cast<std::size_t>(q);
    if (used[k] == kBoth) return;
    if (used[k] == kNothing) gradient[k].setZero();
    if (with_hessian) hessian[k].setZero();
    used[k] = kBoth;
  }
  /// Like Touch, for a load without Hessian: a constant force.
  void TouchGradient(int q) {
    const auto k = static_cast<std::size_t>(q);
    if (used[k] != kNothing) return;
    gradient[k].setZero();
    used[k] = kGradient;
  }

  std::vector<TangentLoad> on_tangents;  ///< in any order; they add up
  std::vector<SpinLoad> on_spins;        ///< as above; room for one per point
  std::vector<BetweenLoad> between;      ///< as above; room for one per segment and instrument
  std::vector<SlideLoad> in_lumen;       ///< ascending by place; room for one per place
  std::vector<SlideLoad> beside;         ///< as above
};

/// Motion of an instrument's surface, driven by its hand, relative to the points.
struct SurfaceMove {
  double along_mm = 0;  ///< along its curve, distally if positive
  double turn_rad = 0;  ///< about the tangent, right-handed
};

struct Sliding;

/// Role *energy term*: an energy of the positions of the wire's points, of its tangents and, if it
/// twists, of its normals. It may couple a point with its spin, but no other two of them. Its
/// gradient must be continuous. Its Hessian may be replaced by a positive semidefinite
/// approximation. Every call with a PointSet is made for each curve, from the innermost outwards.
class EnergyTerm {
 public:
  EnergyTerm() = default;
  EnergyTerm(const EnergyTerm&) = delete;
  EnergyTerm& operator=(const EnergyTerm&) = delete;
  virtual ~EnergyTerm() = default;

  /// Called before a part of the motion, and after a move of the vessel. Stores the state that
  /// stays constant while that part is relaxed. The wire is in equilibrium, or nearly.
  virtual void Begin(const PointSet& points) = 0;
  /// Sets the fraction, 0 .. 1, of the remaining motion that the current part covers. Not called if
  /// no motion remains; the fraction is then 1. A term that knows the time of a tick gives the part
  /// the same fraction of the remaining time.
  virtual void SetMotionFraction(double fraction) { static_cast<void>(fraction); }
  /// True if the result of Add is not energy stored in the wire: dissipated work, or the terms of a
  /// time step. It counts when the wire is relaxed, but not as the wire's energy.
  virtual bool Dissipates() const { return false; }
  /// True if its forces act where the wire's surface touches the wall, as friction does. They then
  /// also turn the wire about its axis and count as contact forces.
  virtual bool ActsOnSurface() const { return false; }
  /// Sliding between instruments, for a term that acts between them and needs PointSet::pressed_N.
  /// Null for all other terms.
  virtual const Sliding* SlidingBetween() const { return nullptr; }
  /// True if the term depends on the relative sliding of the surfaces of curves. It then needs
  /// PointSet::lumen.
  virtual bool SlidesInLumen() const { return false; }
  /// Returns the energy, mJ, and adds its derivatives to `out`.
  virtual double Add(const PointSet& points, PointDerivatives& out) const = 0;
  /// Moves the surfaces of the instruments relative to the points, before the points move. This
  /// applies to instruments that slide within each other, and to instruments that turn without
  /// twist.
  virtual void MoveSurfaces(const PointSet& points,
                            const std::array<SurfaceMove, kMostInstruments>& moves) {
    static_cast<void>(points), static_cast<void>(moves);
  }
  /// Called after that relaxation: updates the term's memory, such as anchors.
  virtual void End(const PointSet& points) = 0;
  /// Clears the term's memory, as at the start of a session.
  virtual void Reset() = 0;
  /// Mixes the term's memory into a hash of the state.
  virtual std::uint64_t Hash(std::uint64_t seed) const = 0;
};

}  // namespace torquer
