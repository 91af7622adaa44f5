// What an effect adds to the energy of the wire.
#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "host/simulator/core/clearance_field.h"
#include "host/simulator/core/frames.h"
#include "host/simulator/core/instrument_place.h"

namespace torquer {

/// A place at which the inner of two curves lies beside the wall of the lumen of the outer one
/// (README, section 18). All are functions of the state: friction in the lumen depends on how they
/// change. The first normal of a surface is fixed to the material of an instrument that twists, and
/// to the segment of others.
struct LumenContact {
  int inner = 0;         ///< instrument whose surface faces the lumen's wall
  int outer = 0;         ///< instrument whose lumen it is
  double radius_mm = 0;  ///< of the inner one
  double lumen_mm = 0;   ///< radius of the lumen
  double force_N = 0;    ///< with which they press each other; 0 where they do not touch
  double ahead_mm = 0;   ///< of the inner curve's place before the outer one's, along the outer one
  /// Of the inner curve from the outer one, across it: by the first and second normal of the lumen.
  Eigen::Vector2d offset_mm = Eigen::Vector2d::Zero();
  double turn_rad = 0;  ///< from the first normal of the lumen to that of the inner surface
};

/// Points of the wire at which wall and effects act: K to a segment, at fractions 1/K .. 1 of it.
/// Point q belongs to segment q / K. All arrays have one entry a point.
struct PointSet {
  int per_segment = 1;                    ///< K
  std::vector<Eigen::Vector3d> position;  ///< mm
  /// Length of wire that the point stands for: half of the piece before it and half of that beyond,
  /// so that the last one has half a piece, and the sheath the first half.
  std::vector<double> weight_mm;
  std::vector<double> radius_mm;           ///< of the wire there
  std::vector<std::uint8_t> touches;       ///< 1 where the wire's surface is beyond the wall
  std::vector<int> near;                   ///< the points that touch or nearly do, ascending
  std::vector<ClearanceSample> clearance;  ///< valid only at `near` points
  std::vector<double> stiffness_N_mm2;     ///< of the wall; valid only at `near` points
  Eigen::Vector3d start = Eigen::Vector3d::Zero();  ///< mm; where the piece of point 0 begins
  /// Normals of a curve that twists, and of a stack how far each instrument on it is turned against
  /// them.
  struct Turns {
    /// One a segment: unit, across it; of a lone wire fixed to its material. Empty of what does not
    /// twist.
    std::vector<Eigen::Vector3d> normals;
    /// One a segment; empty of a lone wire.
    std::vector<std::array<double, kMostInstruments>> angles_rad;
  };
  Turns turns;               ///< of the first curve
  Turns second_turns;        ///< of the second one
  int first_outer = 0;       ///< the innermost instrument on the outer of two curves; else 0
  bool outer_leads = false;  ///< whether the first curve is the outer one
  /// Of a stack that twists, one a segment, where a term asks for it (EnergyTerm::SlidingBetween)
  /// and when it begins a part: the force with which each instrument is pressed against the next
  /// one around it, N.
  std::vector<std::array<double, kMostInstruments>> pressed_N;
  /// Where instruments lie on two curves: 1 at a point of the second one, and the unit tangent of
  /// the curve at each point. Otherwise empty.
  std::vector<std::uint8_t> on_second;
  std::vector<Eigen::Vector3d> tangent;
  /// Of two curves, at the points of the segments that both have: where the other curve is, which
  /// cannot touch the wall there, and its radius. The second curve goes on to the end of its last
  /// segment, beyond its tip. Otherwise empty.
  std::vector<Eigen::Vector3d> covered;
  std::vector<double> covered_radius_mm;
  /// Of two curves, where a term asks for them (EnergyTerm::SlidesInLumen): the places in the
  /// lumen, `lumen_per_segment` to each segment of the second curve, from the sheath on, and as the
  /// last one the end of the shorter curve. Otherwise empty.
  std::vector<LumenContact> lumen;
  int lumen_per_segment = 2;
  int instruments = 1;                                  ///< of the stack
  std::array<double, kMostInstruments> behind_mm = {};  ///< each one's tip, behind the distal end
  double spacing_mm = 1;                                ///< of the points, lambda / K
  double first_spacing_mm = 1;                          ///< of those of the first segment

  int size() const { return static_cast<int>(position.size()); }
  int segments() const { return size() / per_segment; }
  /// Identifies the point as material: constant while the wire moves through the sheath.
  int FromTip(int q) const { return size() - 1 - q; }
  /// The normal, fixed to the material of an instrument, of the segment that the point belongs to.
  Eigen::Vector3d NormalOf(int instrument, int q) const {
    const auto i = static_cast<std::size_t>(q / per_segment);
    const Turns& of = LiesOnSecond(instrument) ? second_turns : turns;
    if (of.angles_rad.empty()) return of.normals[i];
    return TurnedAbout(Tangent(q), of.normals[i],
                       of.angles_rad[i][static_cast<std::size_t>(instrument)]);
  }
  /// True where an instrument lies on the second curve.
  bool LiesOnSecond(int instrument) const {
    return first_outer > 0 && (instrument >= first_outer) != outer_leads;
  }
  /// The same of the surface that is there.
  Eigen::Vector3d Normal(int q) const { return NormalOf(SurfaceAt(q), q); }
  /// Of the instruments `first` to `last` - 1 the outermost that reaches as far as the point; else
  /// the first.
  int OutermostAt(int first, int last, int q) const {
    int k = last - 1;
    while (k > first && behind_mm[static_cast<std::size_t>(k)] > FromTip(q) * spacing_mm) --k;
    return k;
  }
  /// The instrument, counted from the innermost, whose surface touches the wall at the point.
  int SurfaceAt(int q) const { return OutermostAt(0, instruments, q); }
  /// How far the point is from the tip of that instrument, mm.
  double FromTipOf(int instrument, int q) const {
    return FromTip(q) * spacing_mm - behind_mm[static_cast<std::size_t>(instrument)];
  }
  /// Which part of the length that a point stands for an instrument takes: 1 but about its tip.
  double PartOf(int instrument, int q) const {
    const double before_mm = PieceMm(q) / 2;
    const double beyond_mm = q + 1 < size() ? PieceMm(q + 1) / 2 : 0;
    const double from_tip_mm = FromTipMm(q) - behind_mm[static_cast<std::size_t>(instrument)];
    const double reached_mm = std::clamp(from_tip_mm, -before_mm, beyond_mm);
    return (before_mm + reached_mm) / (before_mm + beyond_mm);
  }
  /// How many points a curve has.
  int SizeOf(bool second) const { return second ? static_cast<int>(covered.size()) : size(); }
  /// Where a curve is at one of its points.
  const Eigen::Vector3d& PositionOn(bool second, int q) const {
    const auto p = static_cast<std::size_t>(q);
    return OnSecond(q) == second ? position[p] : covered[p];
  }
  /// Whether the point is one of the second curve.
  bool OnSecond(int q) const {
    return !on_second.empty() && on_second[static_cast<std::size_t>(q)] != 0;
  }
  /// How far the point is from the distal end, mm.
  double FromTipMm(int q) const {
    const int in_first = std::max(0, per_segment - 1 - q);  // pieces shorter or longer than others
    return (FromTip(q) - in_first) * spacing_mm + in_first * first_spacing_mm;
  }
  /// The length of the piece that ends in the point, mm.
  double PieceMm(int q) const { return q < per_segment ? first_spacing_mm : spacing_mm; }
  /// The unit tangent of the segment that the point belongs to.
  Eigen::Vector3d Tangent(int q) const {
    const auto p = static_cast<std::size_t>(q);
    if (!tangent.empty()) return tangent[p];
    return (position[p] - (q == 0 ? start : position[p - 1])) / PieceMm(q);
  }

  /// A place between points: on the piece that ends in `point`, so far before it.
  struct Place {
    int point;         ///< negative: past the sheath
    double before_mm;  ///< negative: beyond the point, on the line of its piece
  };
  /// The place so far from the distal end, >= 0. What is within rounding of a point is at it.
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

/// Derivatives with respect to the unit tangent of a segment, taken as any vector: a moment.
struct TangentLoad {
  int segment;
  Eigen::Vector3d gradient;  ///< mJ
  Eigen::Matrix3d hessian;   ///< mJ, symmetric; only where it is asked for
  bool on_second = false;    ///< of two curves: whether the segment is one of the second
};

/// Derivatives with respect to a spin: a turn of the wire about its tangent at a point. Only of a
/// wire that twists.
struct SpinLoad {
  int point;
  double gradient;                ///< mJ: minus the torque on the wire
  double hessian;                 ///< mJ
  Eigen::Vector3d with_position;  ///< N, d2 / (d spin, d position where it acts)
  double before_mm = 0;           ///< where it acts is so far before the point, on its segment
  int instrument = 0;             ///< of a stack: which one it turns
};

/// Derivatives with respect to how far an instrument is turned in another, at a segment: a torque
/// between them. Only of a stack that twists.
struct BetweenLoad {
  int segment;
  int inner;
  int outer;
  double gradient;  ///< mJ: minus the torque on the inner one, and the torque on the outer one
  double hessian;   ///< mJ
};

/// Derivatives with respect to how far the surfaces at a place of PointSet::lumen have slid against
/// each other: along the lumen by ahead_mm, and around it by around.offset_mm + radius_mm turn_rad.
struct SlideLoad {
  int place;
  Eigen::Vector2d around;    ///< unit, by the normals of the lumen
  Eigen::Vector2d gradient;  ///< N: along, around
  Eigen::Matrix2d hessian;   ///< N/mm, symmetric
};

/// Derivatives with respect to positions.
struct PositionDerivatives {
  bool with_hessian = false;
  /// Which of the two hold something at a point.
  enum Use : std::uint8_t { kNothing, kGradient, kBoth };
  std::vector<std::uint8_t> used;
  std::vector<Eigen::Vector3d> gradient;  ///< N
  std::vector<Eigen::Matrix3d> hessian;   ///< N/mm, symmetric

  /// Room for as many positions, and none used.
  void Clear(std::size_t size) {
    used.assign(size, kNothing);
    gradient.resize(size);
    hessian.resize(size);
  }
  /// Allocates for as many.
  void Reserve(std::size_t size) {
    used.reserve(size);
    gradient.reserve(size);
    hessian.reserve(size);
  }

  /// Makes point q used, starting from zero. Call before adding to it.
  void Touch(int q) {
    const auto k = static_cast<std::size_t>(q);
    if (used[k] == kBoth) return;
    if (used[k] == kNothing) gradient[k].setZero();
    if (with_hessian) hessian[k].setZero();
    used[k] = kBoth;
  }
  /// The same where nothing is added to the Hessian: forces that stay as they are.
  void TouchGradient(int q) {
    const auto k = static_cast<std::size_t>(q);
    if (used[k] != kNothing) return;
    gradient[k].setZero();
    used[k] = kGradient;
  }
};

/// Where the terms put their derivatives with respect to the points' positions, to the tangents of
/// the few segments that bear a moment, to spins, and to slides in a lumen.
struct PointDerivatives : PositionDerivatives {
  PositionDerivatives covered;           ///< with respect to PointSet::covered
  std::vector<TangentLoad> on_tangents;  ///< in any order; they add up
  std::vector<SpinLoad> on_spins;        ///< the same; room for one a point
  std::vector<BetweenLoad> between;      ///< the same; room for one a segment and instrument
  std::vector<SlideLoad> in_lumen;       ///< the same; room for one a place

  /// Those of a curve at one of its points (PointSet::PositionOn).
  PositionDerivatives& On(const PointSet& points, bool second, int q) {
    return points.OnSecond(q) == second ? *this : covered;
  }
};

/// How the surface of an instrument moves with its hand, against the points.
struct SurfaceMove {
  double along_mm = 0;  ///< along the wire, distally if positive
  double turn_rad = 0;  ///< about the tangent, right-handed
};

struct Sliding;

/// Role *energy term*: an energy of the positions of the wire's points, of its tangents and, if it
/// twists, of its normals, without terms that couple several of them but a point and its spin. It
/// must have a continuous gradient; its Hessian may be replaced by a positive semidefinite
/// approximation.
class EnergyTerm {
 public:
  EnergyTerm() = default;
  EnergyTerm(const EnergyTerm&) = delete;
  EnergyTerm& operator=(const EnergyTerm&) = delete;
  virtual ~EnergyTerm() = default;

  /// Before a part of the motion, and after a move of the vessel: takes over from the state
  /// whatever stays constant while that part is relaxed. The state is in balance, or nearly.
  virtual void Begin(const PointSet& points) = 0;
  /// The part that has begun goes `share`, 0 .. 1, of the way that is left to where the hands want
  /// the instruments; where nothing is left to go this is not called, and the share is 1. Terms
  /// that know the time of a tick give the part as much of what is left of it.
  virtual void TakeShare(double share) { static_cast<void>(share); }
  /// Whether what Add returns is not stored in the wire, as work that is lost or what a step of
  /// time adds: it counts when the wire is relaxed, and is no part of its energy.
  virtual bool Dissipates() const { return false; }
  /// Whether its forces act where the wire's surface touches the wall, as friction does: they turn
  /// the wire about its axis, too, and count among the forces of contact.
  virtual bool ActsOnSurface() const { return false; }
  /// How instruments slide in each other, of a term that acts between them and needs
  /// PointSet::pressed_N; null of all others.
  virtual const Sliding* SlidingBetween() const { return nullptr; }
  /// Whether it depends on how the surfaces of two curves slide against each other, and needs
  /// PointSet::lumen.
  virtual bool SlidesInLumen() const { return false; }
  /// Returns the energy, mJ, and adds its derivatives.
  virtual double Add(const PointSet& points, PointDerivatives& out) const = 0;
  /// The surfaces of the instruments move against the points, before these do: instruments that
  /// slide within each other, and instruments that are turned and do not twist.
  virtual void MoveSurfaces(const PointSet& points,
                            const std::array<SurfaceMove, kMostInstruments>& moves) {
    static_cast<void>(points), static_cast<void>(moves);
  }
  /// After that relaxation: updates what the term remembers (anchors, for example).
  virtual void End(const PointSet& points) = 0;
  /// Forgets everything, as at the start of a session.
  virtual void Reset() = 0;
  /// Mixes what the term remembers into a hash of the state.
  virtual std::uint64_t Hash(std::uint64_t seed) const = 0;
};

}  // namespace torquer
